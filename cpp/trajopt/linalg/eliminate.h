// Elimination of one block with its couplings: a left-looking sweep over panels of rows, the last
// panel first. The columns of the block and of both couplings are tiles of one trapezoid.
#pragma once

#include <cfloat>

#include "trajopt/linalg/block_kernels.h"
#include "trajopt/linalg/tile.h"

namespace trajopt::linalg::inline TRAJOPT_ISA {

TRAJOPT_ALWAYS_INLINE double magnitude(double x) { return x < 0.0 ? -x : x; }

// A pivot that lost all its digits to cancellation counts as zero.
inline constexpr double kZeroPivot = 4.0 * DBL_EPSILON;

inline bool good_pivot(double d, double inverse, double sign, double before) {
  if (!(magnitude(d) <= DBL_MAX) || !(magnitude(inverse) <= DBL_MAX)) return false;
  return d * sign > 0.0 && magnitude(d) > kZeroPivot * magnitude(before);
}

// The MR x MR block on the diagonal of a panel: its rows of D W and, once factored, of W.
template <int MR>
struct Corner {
  static constexpr int kStride = vectors(MR) * kWidth;
  alignas(64) double u[MR * kStride];
  double w[MR * MR];

  // Returns the failing row of the block or -1.
  int factor(const Elimination& e, int k0, double* failed) {
#pragma GCC unroll 8
    for (int r = MR - 1; r >= 0; --r) {
      const int k = k0 + r;
      const double sign = e.signs ? e.signs[k] : 1.0;
      const double shift = sign * e.regularization;
      const double d = u[r * kStride + r] + shift;
      const double inverse = 1.0 / d;
      if (!good_pivot(d, inverse, sign, e.original[k * (e.size + 1L)] + shift)) {
        *failed = d;
        return k;
      }
      e.inverse[k] = inverse;
#pragma GCC unroll 8
      for (int s = r - 1; s >= 0; --s) w[r * MR + s] = u[r * kStride + s] * inverse;
#pragma GCC unroll 8
      for (int s = r - 1; s >= 0; --s) {
#pragma GCC unroll 8
        for (int j = 0; j <= s; ++j) {
          u[s * kStride + j] = fnma(w[r * MR + s], u[r * kStride + j], u[s * kStride + j]);
        }
      }
    }
    return -1;
  }

  void write(const Elimination& e, int k0) const {
#pragma GCC unroll 8
    for (int r = 1; r < MR; ++r) {
#pragma GCC unroll 8
      for (int s = 0; s < r; ++s) {
        e.u[(k0 + r) * e.ld + k0 + s] = u[r * kStride + s];
        e.w[(k0 + r) * e.ld + k0 + s] = w[r * MR + s];
      }
    }
  }
};

// The first `columns` columns of panel rows k0..k0+MR-1 of one of the trapezoid's parts. Whole
// vectors are written, up to kWidth - 1 columns too many: a masked store costs more than the tile.
template <int MR>
inline void eliminate_columns(const Elimination& e, int k0, const Corner<MR>& corner,
                              const double* source, long source_ld, double* v, double* u,
                              int columns) {
  const int done = e.size - k0 - MR;
  const long last = (e.size - 1) * e.ld;
  const Scalars scalars{e.w + last + k0, -e.ld, 1};
  int left = vectors(columns);
  for (int c = 0; left > 0;) {
    const int nv = next_vectors(left);
    with_constant<kTileVectors>(nv, [&]<int NV>() {
      Tile<MR, NV> tile;
      tile.template read<false>(source + k0 * source_ld + c, source_ld, 0);
      tile.template subtract<false>(done, scalars, u + last + c, -e.ld, 0);
      tile.substitute_transposed(corner.w, MR);
      tile.template write<false>(u + k0 * e.ld + c, e.ld, 0);
#pragma GCC unroll 8
      for (int r = 0; r < MR; ++r) {
        const Vector inverse = broadcast(e.inverse[k0 + r]);
#pragma GCC unroll 3
        for (int i = 0; i < NV; ++i) tile.a[r][i] = mul(tile.a[r][i], inverse);
      }
      tile.template write<false>(v + k0 * e.ld + c, e.ld, 0);
    });
    c += nv * kWidth;
    left -= nv;
  }
}

template <int MR>
inline int eliminate_panel(const Elimination& e, int k0, double* failed) {
  Corner<MR> corner;
  const int done = e.size - k0 - MR;
  const long last = (e.size - 1) * e.ld;
  Tile<MR, vectors(MR)> tile;
  tile.template read<false>(e.diagonal + k0 * e.diagonal_ld + k0, e.diagonal_ld, 0);
  tile.template subtract<false>(done, {e.w + last + k0, -e.ld, 1}, e.u + last + k0, -e.ld, 0);
  tile.template write<false>(corner.u, Corner<MR>::kStride, 0);
  const int row = corner.factor(e, k0, failed);
  if (row >= 0) return row;
  eliminate_columns<MR>(e, k0, corner, e.diagonal, e.diagonal_ld, e.w, e.u, k0);
  corner.write(e, k0);  // after its neighbours, whose last vector may have covered it
  const Coupling* couplings[] = {&e.left, &e.right};
  for (const Coupling* s : couplings) {
    if (s->u) eliminate_columns<MR>(e, k0, corner, s->source, s->source_ld, s->v, s->u, e.size);
  }
  return -1;
}

inline Pivot eliminate(const Elimination& e) {
  Pivot pivot;
  for (int end = e.size; end > 0 && pivot.row < 0;) {
    const int rows = next_panel(end);
    with_constant<kTileRows>(
        rows, [&]<int MR>() { pivot.row = eliminate_panel<MR>(e, end - MR, &pivot.value); });
    end -= rows;
  }
  return pivot;
}

}  // namespace trajopt::linalg::inline TRAJOPT_ISA
