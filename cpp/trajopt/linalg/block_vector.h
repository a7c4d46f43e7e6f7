// Block times one vector: triangular substitution and products, vectorized over the rows of the
// result, transposing in registers where the matrix is read along its rows. block_columns.h has the
// same for several columns at once; each element sees the same chain of operations in both.
//
// `ahead` is how far away from what is read memory is asked for: a solution reads the factors once
// from one end to the other and back, and waits for nothing else.
#pragma once

#include "trajopt/linalg/block_kernels.h"
#include "trajopt/linalg/tile.h"

namespace trajopt::linalg::inline TRAJOPT_ISA {

// y[0..columns) -= Vt x for `rows` rows of V, the last one first.
template <class T>
inline void subtract_transposed_one(int rows, int columns, const T* v, long ld, const T* x, T* y,
                                    long ahead) {
  constexpr int kMost = 8, W = kWidth<T>;
  for (int c = 0; c < columns;) {
    const int left = vectors<T>(columns - c), nv = left < kMost ? left : kMost;
    const int tail = columns - c < nv * W ? columns - c - (nv - 1) * W : W;
    with_constant<kMost>(nv, [&]<int NV>() {
      Vec<T> a[NV];
#pragma GCC unroll 8
      for (int i = 0; i < NV; ++i) {
        a[i] = i == NV - 1 ? load(y + c + i * W, tail) : load(y + c + i * W);
      }
      for (int k = rows - 1; k >= 0; --k) {
        const Vec<T> s = broadcast(x[k]);
        const T* row = v + k * ld + c;
#pragma GCC unroll 8
        for (int i = 0; i < NV; ++i) {
          if (i * W % kLine<T> == 0) prefetch(row + i * W + ahead);
          a[i] = fnma(s, load(row + i * W), a[i]);
        }
      }
#pragma GCC unroll 8
      for (int i = 0; i < NV; ++i) {
        if (i == NV - 1) {
          store(y + c + i * W, a[i], tail);
        } else {
          store(y + c + i * W, a[i]);
        }
      }
    });
    c += nv * W;
  }
}

// a -= the W rows from `square` on, times x[0..W): its columns in ascending order.
template <class T>
TRAJOPT_ALWAYS_INLINE void subtract_square(const T* square, long ld, const T* x, long ahead,
                                           Vec<T>& a) {
  constexpr int W = kWidth<T>;
  Vec<T> t[W];
#pragma GCC unroll 16
  for (int r = 0; r < W; ++r) {
    prefetch(square + r * ld + ahead);
    t[r] = load(square + r * ld);
  }
  transpose(t);
#pragma GCC unroll 16
  for (int j = 0; j < W; ++j) a = fnma(broadcast(x[j]), t[j], a);
}

// y[0..rows) -= V x for `columns` columns of V, the first one first.
template <class T>
inline void subtract_one(int rows, int columns, const T* v, long ld, const T* x, T* y, long ahead) {
  constexpr int W = kWidth<T>;
  const int whole = rows / W * W, whole_columns = columns / W * W;
  for (int r0 = 0; r0 < whole; r0 += W) {
    Vec<T> a = load(y + r0);
    for (int c = 0; c < whole_columns; c += W) {
      subtract_square(v + r0 * ld + c, ld, x + c, ahead, a);
    }
    store(y + r0, a);
  }
  for (int r = 0; r < rows; ++r) {
    const T* row = v + r * ld;
    T a = y[r];
    for (int c = r < whole ? whole_columns : 0; c < columns; ++c) a = fnma(x[c], row[c], a);
    y[r] = a;
  }
}

// Panels of W columns of the packed W, the last one first.
template <class T>
inline void substitute_transposed_one(int size, const T* packed, T* x, long ahead) {
  constexpr int W = kWidth<T>, L = kLine<T>;
  for (int c = (size - 1) / W * W; c >= 0; c -= W) {
    const int height = size - c < W ? size - c : W;
    const T* corner = packed + PackedTriangle<T>::at(size, c, c);
    Vec<T> a = load(x + c, height);
    for (int k = size - 1; k >= c + W; --k) {
      const T* row = corner + (k - c) * static_cast<long>(L);
      prefetch(row + ahead);
      a = fnma(broadcast(x[k]), load(row), a);
    }
#pragma GCC unroll 16
    for (int r = W - 1; r > 0; --r) {
      prefetch(corner + r * L + ahead);
      if (r < height) a = fnma_first(r, broadcast_lane(a, r), load(corner + r * L), a);
    }
    prefetch(corner + ahead);
    store(x + c, a, height);
  }
}

template <class T>
inline void substitute_one(int size, const T* packed, T* x, long ahead) {
  constexpr int W = kWidth<T>, L = kLine<T>;
  for (int r0 = 0; r0 < size; r0 += W) {
    const int height = size - r0 < W ? size - r0 : W;
    Vec<T> a = load(x + r0, height);
    for (int c = 0; c < r0; c += W) {
      subtract_square(packed + PackedTriangle<T>::at(size, r0, c), L, x + c, ahead, a);
    }
    const T* corner = packed + PackedTriangle<T>::at(size, r0, r0);
    Vec<T> t[W];
#pragma GCC unroll 16
    for (int r = 0; r < W; ++r) {
      prefetch(corner + r * L + ahead);
      t[r] = load(corner + r * L);
    }
    transpose(t);
#pragma GCC unroll 16
    for (int s = 0; s + 1 < W; ++s) {
      if (s + 1 < height) a = fnma_from(s + 1, broadcast_lane(a, s), t[s], a);
    }
    store(x + r0, a, height);
  }
}

template <class T>
inline void subtract_symmetric_one(int size, const T* a, long ld, const T* x, T* y) {
  constexpr int W = kWidth<T>;
  for (int k0 = 0; k0 < size; k0 += W) {
    const int height = size - k0 < W ? size - k0 : W;
    const T* panel = a + k0 * ld;
    subtract_one(height, k0, panel, ld, x, y + k0, 0);
    for (int j = 0; j < height; ++j) {
      for (int r = 0; r < height; ++r) {
        const T s = j >= r ? panel[j * ld + k0 + r] : panel[r * ld + k0 + j];
        y[k0 + r] = fnma(s, x[k0 + j], y[k0 + r]);
      }
    }
    // The rows below, whose first columns are this panel's, come in ascending order.
    Vec<T> acc = load(y + k0, height);
    for (int j = k0 + height; j < size; ++j) {
      acc = fnma(broadcast(x[j]), load(a + j * ld + k0), acc);
    }
    store(y + k0, acc, height);
  }
}

}  // namespace trajopt::linalg::inline TRAJOPT_ISA
