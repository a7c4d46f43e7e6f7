// target = source - Vt U, whole or lower triangle, and the transposed copy.
#pragma once

#include "trajopt/linalg/tile.h"

namespace trajopt::linalg::inline TRAJOPT_ISA {

template <int MR>
inline void update_panel(int r0, int columns, int k, const double* source, long source_ld,
                         double* target, long target_ld, const double* v, const double* u,
                         long ld) {
  const long last = (k - 1L) * ld;
  const Scalars scalars{v + last + r0, -ld, 1};
  int left = vectors(columns);
  for (int c = 0; left > 0;) {
    const int nv = next_vectors(left);
    with_constant<kTileVectors>(nv, [&]<int NV>() {
      Tile<MR, NV> tile;
      if (source) {
        tile.template read<false>(source + r0 * source_ld + c, source_ld, 0);
      } else {
        tile.clear();
      }
      tile.template subtract<false>(k, scalars, u + last + c, -ld, 0);
      tile.template write<false>(target + r0 * target_ld + c, target_ld, 0);
    });
    c += nv * kWidth;
    left -= nv;
  }
}

inline void update(int rows, int columns, int k, const double* source, long source_ld,
                   double* target, long target_ld, const double* v, const double* u, long ld,
                   bool lower) {
  for (int r0 = 0; r0 < rows;) {
    const int height = next_panel(rows - r0);
    with_constant<kTileRows>(height, [&]<int MR>() {
      update_panel<MR>(r0, lower ? r0 + MR : columns, k, source, source_ld, target, target_ld, v, u,
                       ld);
    });
    r0 += height;
  }
}

inline void transpose_block(int size, const double* source, long source_ld, double* target,
                            long target_ld) {
  const int whole = size / kWidth * kWidth;
  for (int i = 0; i < whole; i += kWidth) {
    for (int j = 0; j < whole; j += kWidth) {
      Vector rows[kWidth];
#pragma GCC unroll 8
      for (int r = 0; r < kWidth; ++r) rows[r] = load(source + (i + r) * source_ld + j);
      transpose(rows);
#pragma GCC unroll 8
      for (int r = 0; r < kWidth; ++r) store(target + (j + r) * target_ld + i, rows[r]);
    }
  }
  for (int i = 0; i < size; ++i) {
    for (int j = i < whole ? whole : 0; j < size; ++j) {
      target[j * target_ld + i] = source[i * source_ld + j];
    }
  }
}

}  // namespace trajopt::linalg::inline TRAJOPT_ISA
