// target = source - Vt U, whole or lower triangle, and the ways blocks are moved about.
#pragma once

#include "trajopt/linalg/block_kernels.h"
#include "trajopt/linalg/tile.h"

namespace trajopt::linalg::inline TRAJOPT_ISA {

template <int MR, class T>
inline void update_panel(int r0, int columns, int k, const T* source, long source_ld, T* target,
                         long target_ld, const T* v, long v_ld, const T* u, long u_ld) {
  const Scalars<T> scalars{v + (k - 1L) * v_ld + r0, -v_ld, 1};
  const T* last = u + (k - 1L) * u_ld;
  int left = vectors<T>(columns);
  for (int c = 0; left > 0;) {
    const int nv = next_vectors(left);
    with_constant<kTileVectors>(nv, [&]<int NV>() {
      Tile<T, MR, NV> tile;
      if (source) {
        tile.template read<false>(source + r0 * source_ld + c, source_ld, 0);
      } else {
        tile.clear();
      }
      tile.template subtract<false>(k, scalars, last + c, -u_ld, 0);
      tile.template write<false>(target + r0 * target_ld + c, target_ld, 0);
    });
    c += nv * kWidth<T>;
    left -= nv;
  }
}

// The last panel goes first: with it the elimination of the target begins.
template <class T>
inline void update(int rows, int columns, int k, const T* source, long source_ld, T* target,
                   long target_ld, const T* v, long v_ld, const T* u, long u_ld, bool lower) {
  for (int end = rows; end > 0;) {
    const int height = next_panel(end);
    with_constant<kTileRows>(height, [&]<int MR>() {
      const int r0 = end - MR;
      update_panel<MR>(r0, lower ? end : columns, k, source, source_ld, target, target_ld, v, v_ld,
                       u, u_ld);
    });
    end -= height;
  }
}

template <class T>
inline void transpose_block(int size, const T* source, long source_ld, T* target, long target_ld) {
  constexpr int W = kWidth<T>;
  const int whole = size / W * W;
  for (int i = 0; i < whole; i += W) {
    for (int j = 0; j < whole; j += W) {
      Vec<T> rows[W];
#pragma GCC unroll 16
      for (int r = 0; r < W; ++r) rows[r] = load(source + (i + r) * source_ld + j);
      transpose(rows);
#pragma GCC unroll 16
      for (int r = 0; r < W; ++r) store(target + (j + r) * target_ld + i, rows[r]);
    }
  }
  for (int i = 0; i < size; ++i) {
    for (int j = i < whole ? whole : 0; j < size; ++j) {
      target[j * target_ld + i] = source[i * source_ld + j];
    }
  }
}

template <class T>
inline void convert(int size, const double* source, T* target, long target_ld, bool lower) {
  for (int i = 0; i < size; ++i) {
    const double* from = source + static_cast<long>(i) * size;
    T* to = target + i * target_ld;
    const int columns = lower ? i + 1 : size;
    for (int j = 0; j < columns; ++j) to[j] = static_cast<T>(from[j]);
  }
}

}  // namespace trajopt::linalg::inline TRAJOPT_ISA
