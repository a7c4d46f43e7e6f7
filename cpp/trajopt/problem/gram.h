// Gram matrix of a few rows in SIMD lanes: H_qp += J_q^T J_p for the six blocks of a window.
//
// Each element accumulates over the rows in ascending order with fma, whatever the tiling.
#pragma once

#include "trajopt/problem/frame_kernels.h"

namespace trajopt::inline TRAJOPT_ISA {

template <class S, int TI, int TJ>
TRAJOPT_HD inline void gram_tile(const S* a, const S* b, int rows, int stride, S* h, int ld) {
  S c[TI][TJ];
  for (int i = 0; i < TI; ++i)
    for (int j = 0; j < TJ; ++j) c[i][j] = S(0.0);
  for (int r = 0; r < rows; ++r) {
    for (int i = 0; i < TI; ++i)
      for (int j = 0; j < TJ; ++j) c[i][j] = fma(a[r * stride + i], b[r * stride + j], c[i][j]);
  }
  for (int i = 0; i < TI; ++i)
    for (int j = 0; j < TJ; ++j) h[i * ld + j] = c[i][j];
}

// h (6 x d x d) = the window's blocks; jacobian is rows x 3d. Diagonal blocks come out whole.
template <class S>
TRAJOPT_HD inline void window_gram(const S* jacobian, int rows, int d, S* h) {
  constexpr int T = lanes<S> == 8 ? 4 : 2;
  const int stride = 3 * d;
  for (int block = 0; block < 6; ++block) {
    const S* a = jacobian + kWindowBlocks[block][0] * d;
    const S* b = jacobian + kWindowBlocks[block][1] * d;
    const bool diagonal = kWindowBlocks[block][0] == kWindowBlocks[block][1];
    S* out = h + block * d * d;
    int i = 0;
    for (; i + T <= d; i += T) {
      const int last = diagonal ? i + T : d;
      int j = 0;
      for (; j + T <= last; j += T)
        gram_tile<S, T, T>(a + i, b + j, rows, stride, out + i * d + j, d);
      for (; j < last; ++j) gram_tile<S, T, 1>(a + i, b + j, rows, stride, out + i * d + j, d);
    }
    for (; i < d; ++i) {
      const int last = diagonal ? i + 1 : d;
      for (int j = 0; j < last; ++j)
        gram_tile<S, 1, 1>(a + i, b + j, rows, stride, out + i * d + j, d);
    }
    if (diagonal) {
      for (int r = 0; r < d; ++r)
        for (int c = r + 1; c < d; ++c) out[r * d + c] = out[c * d + r];
    }
  }
}

}  // namespace trajopt::inline TRAJOPT_ISA
