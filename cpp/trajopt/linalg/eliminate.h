// Elimination of one block with its couplings: a left-looking sweep over panels of rows, the last
// panel first. The columns of the block and of both couplings are tiles of one trapezoid.
#pragma once

#include "trajopt/linalg/corner.h"
#include "trajopt/linalg/traffic.h"

namespace trajopt::linalg::inline TRAJOPT_ISA {

// Reads a tile at (k0, c) of the block itself, with the update that is pending.
template <class T, int MR, int NV>
TRAJOPT_ALWAYS_INLINE void read_block(const BasicElimination<T>& e, int k0, int c,
                                      Tile<T, MR, NV>& tile) {
  tile.template read<false>(e.diagonal + k0 * e.diagonal_ld + c, e.diagonal_ld, 0);
  if (!e.pending_v) return;
  const long last = (e.size - 1) * e.ld;
  tile.template subtract<false>(e.size, {e.pending_v + last + k0, -e.ld, 1}, e.pending_u + last + c,
                                -e.ld, 0);
}

// W from its last row up, in the columns of the panel of rows from k0 on. Such a panel begins at a
// multiple of kTileRows, so that these columns are in one packed panel.
template <class T>
TRAJOPT_ALWAYS_INLINE Scalars<T> scalars_of_w(const BasicElimination<T>& e, int k0) {
  return {e.w + PackedTriangle<T>::at(e.size, e.size - 1, k0), -kLine<T>, 1};
}

// The first `columns` columns of panel rows k0..k0+MR-1 of one of the trapezoid's parts. Whole
// vectors are written, up to kWidth - 1 columns too many: a masked store costs more than the tile.
// Divided by the pivots, the rows of the vector of column c go to place(c), `step` elements apart.
template <int MR, class T, class Read, class Place>
inline void eliminate_columns(const BasicElimination<T>& e, int k0, const Corner<T>& corner,
                              const Read& read, const Place& place, long step, T* u, int columns,
                              int rows_to_move) {
  const int done = e.size - k0 - MR;
  const long last = (e.size - 1) * e.ld;
  const Scalars<T> scalars = scalars_of_w(e, k0);
  int left = vectors<T>(columns);
  for (int c = 0; left > 0;) {
    const int nv = next_vectors(left);
    with_constant<kTileVectors>(nv, [&]<int NV>() {
      Tile<T, MR, NV> tile;
      read(c, tile);
      tile.template subtract<false>(done, scalars, u + last + c, -e.ld, 0);
      T* to[NV];
#pragma GCC unroll 3
      for (int i = 0; i < NV; ++i) to[i] = place(c + i * kWidth<T>);
        // Each row is written as soon as it is final: together at the end, they would fill the
        // store queue and keep the next tile waiting.
#pragma GCC unroll 8
      for (int r = MR - 1; r >= 0; --r) {
        const Vec<T> inverse = broadcast(corner.inverse[r]);
#pragma GCC unroll 3
        for (int i = 0; i < NV; ++i) {
          store(u + (k0 + r) * e.ld + c + i * kWidth<T>, tile.a[r][i]);
          store(to[i] + r * step, mul(tile.a[r][i], inverse));
        }
        tile.substitute_row(r, corner.w + r * Corner<T>::kStride);
      }
    });
    if (rows_to_move > 0) move(*e.traffic, rows_to_move);
    c += nv * kWidth<T>;
    left -= nv;
  }
}

// Factors the corner of panel rows k0..k0+MR-1.
template <int MR, class T>
inline void factor_corner(const BasicElimination<T>& e, int k0, Corner<T>& corner) {
  const int done = e.size - k0 - MR;
  const long last = (e.size - 1) * e.ld + k0;
  Tile<T, MR, vectors<T>(MR)> tile;
  tile.template read<false>(e.diagonal + k0 * (e.diagonal_ld + 1L), e.diagonal_ld, 0);
  if (e.pending_v) {
    subtract_square<T, MR>(e.size, {e.pending_v + last, -e.ld, 1}, e.pending_u + last, -e.ld, tile);
  }
  subtract_square<T, MR>(done, scalars_of_w(e, k0), e.u + last, -e.ld, tile);
  corner.template prepare<MR>(e, k0);
  if (e.regularization != 0.0) {
    corner.template factor<MR, true>(tile);
  } else {
    corner.template factor<MR, false>(tile);
  }
}

// The columns of the block itself to the left of the corner, and the corner's rows.
template <int MR, class T>
inline void finish_rows(const BasicElimination<T>& e, int k0, const Corner<T>& corner,
                        int rows_to_move) {
  const auto read = [&](int c, auto& tile) { read_block(e, k0, c, tile); };
  const auto place = [&](int c) { return e.w + PackedTriangle<T>::at(e.size, k0, c); };
  eliminate_columns<MR>(e, k0, corner, read, place, kLine<T>, e.u, k0, rows_to_move);
  corner.template write<MR>(e, k0);  // last: the columns before may have covered its first vector
}

template <int MR, class T>
inline void eliminate_couplings(const BasicElimination<T>& e, int k0, const Corner<T>& corner,
                                int rows_to_move) {
  const BasicCoupling<T>* couplings[] = {&e.left, &e.right};
  for (const BasicCoupling<T>* s : couplings) {
    if (!s->u) continue;
    const auto read = [&](int c, auto& tile) {
      tile.template read<false>(s->source + k0 * s->source_ld + c, s->source_ld, 0);
    };
    const auto place = [&](int c) { return s->v + k0 * e.ld + c; };
    eliminate_columns<MR>(e, k0, corner, read, place, e.ld, s->u, s->columns, rows_to_move);
  }
}

// Rows of traffic per tile, so that all is done when the elimination is.
template <class T>
inline int rows_per_tile(const BasicElimination<T>& e) {
  const int couplings = (e.left.u != nullptr) + (e.right.u != nullptr);
  const int panels = (e.size + kTileRows - 1) / kTileRows;
  const int across = (e.size + kTileColumns<T> - 1) / kTileColumns<T>;
  const int tiles = panels * (across * couplings + across / 2);
  return tiles > 0 ? (e.size + tiles - 1) / tiles : e.size;
}

// A panel's couplings come after the next panel's corner: the one is throughput, the other latency,
// and the processor overlaps them.
template <class T>
inline Pivot eliminate(const BasicElimination<T>& e) {
  Corner<T> corners[2];
  const int to_move = e.traffic ? rows_per_tile(e) : 0;
  int rows = next_panel(e.size), k0 = e.size - rows;
  const auto begin = [&](Corner<T>& corner) {
    with_constant<kTileRows>(rows, [&]<int MR>() { factor_corner<MR>(e, k0, corner); });
  };
  begin(corners[0]);
  for (int panel = 0;; ++panel) {
    const Corner<T>& corner = corners[panel % 2];
    const int this_k0 = k0, this_rows = rows;
    with_constant<kTileRows>(rows, [&]<int MR>() { finish_rows<MR>(e, k0, corner, to_move); });
    if (this_k0 > 0) {
      rows = next_panel(k0);
      k0 -= rows;
      begin(corners[(panel + 1) % 2]);
    }
    const int bad = corner.check(e, this_k0, this_rows);
    if (bad >= 0) return {this_k0 + bad, static_cast<double>(corner.pivot[bad])};
    with_constant<kTileRows>(
        this_rows, [&]<int MR>() { eliminate_couplings<MR>(e, this_k0, corner, to_move); });
    if (this_k0 == 0) return {};
  }
}

}  // namespace trajopt::linalg::inline TRAJOPT_ISA
