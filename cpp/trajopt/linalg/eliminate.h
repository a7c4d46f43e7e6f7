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

// Factors the MR x MR block on the diagonal of a panel. Returns the failing row or -1.
template <int MR>
inline int factor_panel(const Elimination& e, int k0, double* block, long ldb, double* failed) {
#pragma GCC unroll 8
  for (int r = MR - 1; r >= 0; --r) {
    const int k = k0 + r;
    const double sign = e.signs ? e.signs[k] : 1.0;
    const double shift = sign * e.regularization;
    const double d = block[r * ldb + r] + shift;
    const double inverse = 1.0 / d;
    if (!good_pivot(d, inverse, sign, e.original[k * (e.size + 1L)] + shift)) {
      *failed = d;
      return k;
    }
    e.inverse[k] = inverse;
    double w[MR];
#pragma GCC unroll 8
    for (int s = r - 1; s >= 0; --s) {
      w[s] = block[r * ldb + s] * inverse;
      e.u[k * e.ld + k0 + s] = block[r * ldb + s];
      e.w[k * e.ld + k0 + s] = w[s];
    }
#pragma GCC unroll 8
    for (int s = r - 1; s >= 0; --s) {
#pragma GCC unroll 8
      for (int j = 0; j <= s; ++j) {
        block[s * ldb + j] = fnma(w[s], block[r * ldb + j], block[s * ldb + j]);
      }
    }
  }
  return -1;
}

// Columns [begin, end) of panel rows k0..k0+MR-1 of one of the trapezoid's parts.
template <int MR>
inline void eliminate_columns(const Elimination& e, int k0, const double* source, long source_ld,
                              double* v, double* u, int columns) {
  const int done = e.size - k0 - MR;
  const long last = (e.size - 1) * e.ld;
  const Scalars scalars{e.w + last + k0, -e.ld, 1};
  int left = vectors(columns);
  for (int c = 0; left > 0;) {
    const int nv = next_vectors(left);
    const int tail = left == nv ? columns - c - (nv - 1) * kWidth : kWidth;
    const auto body = [&]<int NV>() {
      Tile<MR, NV> tile;
      tile.template read<false>(source + k0 * source_ld + c, source_ld, 0);
      tile.template subtract<false>(done, scalars, u + last + c, -e.ld, 0);
      tile.substitute_transposed(e.w + k0 * e.ld + k0, e.ld);
      tile.template write<true>(u + k0 * e.ld + c, e.ld, tail);
#pragma GCC unroll 8
      for (int r = 0; r < MR; ++r) {
        const Vector inverse = broadcast(e.inverse[k0 + r]);
#pragma GCC unroll 3
        for (int i = 0; i < NV; ++i) tile.a[r][i] = mul(tile.a[r][i], inverse);
      }
      tile.template write<true>(v + k0 * e.ld + c, e.ld, tail);
    };
    with_constant<kTileVectors>(nv, body);
    c += nv * kWidth;
    left -= nv;
  }
}

template <int MR>
inline int eliminate_panel(const Elimination& e, int k0, double* failed) {
  constexpr int kVectors = vectors(MR);
  alignas(64) double block[MR * kVectors * kWidth];
  const int done = e.size - k0 - MR;
  const long last = (e.size - 1) * e.ld;
  Tile<MR, kVectors> tile;
  tile.template read<false>(e.diagonal + k0 * e.diagonal_ld + k0, e.diagonal_ld, 0);
  tile.template subtract<false>(done, {e.w + last + k0, -e.ld, 1}, e.u + last + k0, -e.ld, 0);
  tile.template write<false>(block, kVectors * kWidth, 0);
  const int row = factor_panel<MR>(e, k0, block, kVectors * kWidth, failed);
  if (row >= 0) return row;
  eliminate_columns<MR>(e, k0, e.diagonal, e.diagonal_ld, e.w, e.u, k0);
  if (e.left.u) {
    eliminate_columns<MR>(e, k0, e.left.source, e.left.source_ld, e.left.v, e.left.u, e.size);
  }
  if (e.right.u) {
    eliminate_columns<MR>(e, k0, e.right.source, e.right.source_ld, e.right.v, e.right.u, e.size);
  }
  return -1;
}

// Asks for the part of the next step's memory that falls to rows [begin, end) of this one.
inline void fetch_ahead(const Elimination& e, int begin, int end) {
  for (const Elimination::Ahead& ahead : e.ahead) {
    const long first = ahead.count * begin / e.size / 8 * 8, last = ahead.count * end / e.size;
    for (long i = first; i < last; i += 8) __builtin_prefetch(ahead.data + i, 0, 2);
  }
}

inline Pivot eliminate(const Elimination& e) {
  Pivot pivot;
  for (int end = e.size; end > 0 && pivot.row < 0;) {
    const int rows = next_panel(end);
    fetch_ahead(e, e.size - end, e.size - end + rows);
    with_constant<kTileRows>(
        rows, [&]<int MR>() { pivot.row = eliminate_panel<MR>(e, end - MR, &pivot.value); });
    end -= rows;
  }
  return pivot;
}

}  // namespace trajopt::linalg::inline TRAJOPT_ISA
