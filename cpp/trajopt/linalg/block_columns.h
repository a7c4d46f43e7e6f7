// Block times vectors. Of more than two, the columns of the right-hand side are the vector lanes.
#pragma once

#include "trajopt/linalg/block_vector.h"

namespace trajopt::linalg::inline TRAJOPT_ISA {

// Applies body<MR, NV>(first row, first column, columns of the last vector) to tiles of a
// size x m matrix. Tiles start at multiples of kTileRows, so that none straddles two packed panels.
template <bool Descending, class T, class Body>
inline void for_tiles(int size, int m, const Body& body) {
  for (int c = 0; c < m; c += kTileColumns<T>) {
    const int columns = m - c < kTileColumns<T> ? m - c : kTileColumns<T>;
    const int tail = columns - (vectors<T>(columns) - 1) * kWidth<T>;
    with_constant<kTileVectors>(vectors<T>(columns), [&]<int NV>() {
      const int panels = (size + kTileRows - 1) / kTileRows;
      for (int p = 0; p < panels; ++p) {
        const int r0 = (Descending ? panels - 1 - p : p) * kTileRows;
        const int height = size - r0 < kTileRows ? size - r0 : kTileRows;
        with_constant<kTileRows>(height,
                                 [&]<int MR>() { body.template operator()<MR, NV>(r0, c, tail); });
      }
    });
  }
}

template <class T>
inline void substitute_transposed(int size, const T* packed, T* x, int m, long ldx, long ahead) {
  if (m == 1 && ldx == 1) return substitute_transposed_few<1>(size, packed, x, ahead);
  if (m == 2 && ldx == 2) return substitute_transposed_few<2>(size, packed, x, ahead);
  constexpr long L = kLine<T>;
  for_tiles<true, T>(size, m, [&]<int MR, int NV>(int k0, int c, int tail) {
    const T* corner = packed + PackedTriangle<T>::at(size, k0, k0);
    Tile<T, MR, NV> tile;
    tile.template read<true>(x + k0 * ldx + c, ldx, tail);
    tile.template subtract<true>(size - k0 - MR, {corner + (size - 1 - k0) * L, -L, 1},
                                 x + (size - 1) * ldx + c, -ldx, tail);
    tile.substitute_transposed(corner, L);
    tile.template write<true>(x + k0 * ldx + c, ldx, tail);
  });
}

template <class T>
inline void substitute(int size, const T* packed, T* x, int m, long ldx, long ahead) {
  if (m == 1 && ldx == 1) return substitute_few<1>(size, packed, x, ahead);
  if (m == 2 && ldx == 2) return substitute_few<2>(size, packed, x, ahead);
  constexpr int L = kLine<T>;
  for_tiles<false, T>(size, m, [&]<int MR, int NV>(int k0, int c, int tail) {
    Tile<T, MR, NV> tile;
    tile.template read<true>(x + k0 * ldx + c, ldx, tail);
    for (int k = 0; k < k0; k += L) {
      tile.template subtract<true>(k0 - k < L ? k0 - k : L,
                                   {packed + PackedTriangle<T>::at(size, k0, k), 1, L},
                                   x + k * ldx + c, ldx, tail);
    }
    tile.substitute(packed + PackedTriangle<T>::at(size, k0, k0), L);
    tile.template write<true>(x + k0 * ldx + c, ldx, tail);
  });
}

template <class T>
inline void scale(int size, const T* d, T* x, int m) {
  if (m == 1) return scale_few<1>(size, d, x);
  if (m == 2) return scale_few<2>(size, d, x);
  for (int k = 0; k < size; ++k) {
    for (int j = 0; j < m; ++j) x[static_cast<long>(k) * m + j] *= d[k];
  }
}

template <class T>
inline void subtract_transposed(int rows, int columns, const T* v, long ld, const T* x, T* y, int m,
                                long ldx, long ldy, long ahead) {
  if (m <= 2 && ldx == m && ldy == m) {
    return m == 1 ? subtract_transposed_few<1>(rows, columns, v, ld, x, y, ahead)
                  : subtract_transposed_few<2>(rows, columns, v, ld, x, y, ahead);
  }
  for_tiles<false, T>(columns, m, [&]<int MR, int NV>(int k0, int c, int tail) {
    Tile<T, MR, NV> tile;
    tile.template read<true>(y + k0 * ldy + c, ldy, tail);
    tile.template subtract<true>(rows, {v + (rows - 1) * ld + k0, -ld, 1}, x + (rows - 1) * ldx + c,
                                 -ldx, tail);
    tile.template write<true>(y + k0 * ldy + c, ldy, tail);
  });
}

template <class T>
inline void subtract(int rows, int columns, const T* v, long ld, const T* x, T* y, int m, long ldx,
                     long ldy, long ahead) {
  if (m <= 2 && ldx == m && ldy == m) {
    return m == 1 ? subtract_few<1>(rows, columns, v, ld, x, y, ahead)
                  : subtract_few<2>(rows, columns, v, ld, x, y, ahead);
  }
  for_tiles<false, T>(rows, m, [&]<int MR, int NV>(int k0, int c, int tail) {
    Tile<T, MR, NV> tile;
    tile.template read<true>(y + k0 * ldy + c, ldy, tail);
    tile.template subtract<true>(columns, {v + k0 * ld, 1, ld}, x + c, ldx, tail);
    tile.template write<true>(y + k0 * ldy + c, ldy, tail);
  });
}

template <class T>
inline void subtract_symmetric(int size, const T* a, long ld, const T* x, T* y, int m, long ldx,
                               long ldy, long ahead) {
  if (m <= 2 && ldx == m && ldy == m) {
    return m == 1 ? subtract_symmetric_few<1>(size, a, ld, x, y, ahead)
                  : subtract_symmetric_few<2>(size, a, ld, x, y, ahead);
  }
  for_tiles<false, T>(size, m, [&]<int MR, int NV>(int k0, int c, int tail) {
    T panel[MR * MR];  // the block on the diagonal, both triangles
    for (int j = 0; j < MR; ++j) {
      for (int r = 0; r < MR; ++r) {
        panel[j * MR + r] = j >= r ? a[(k0 + j) * ld + k0 + r] : a[(k0 + r) * ld + k0 + j];
      }
    }
    Tile<T, MR, NV> tile;
    tile.template read<true>(y + k0 * ldy + c, ldy, tail);
    tile.template subtract<true>(k0, {a + k0 * ld, 1, ld}, x + c, ldx, tail);
    tile.template subtract<true>(MR, {panel, MR, 1}, x + k0 * ldx + c, ldx, tail);
    tile.template subtract<true>(size - k0 - MR, {a + (k0 + MR) * ld + k0, ld, 1},
                                 x + (k0 + MR) * ldx + c, ldx, tail);
    tile.template write<true>(y + k0 * ldy + c, ldy, tail);
  });
}

}  // namespace trajopt::linalg::inline TRAJOPT_ISA
