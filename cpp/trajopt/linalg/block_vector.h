// Block times one or two vectors: triangular substitution and products, vectorized over the rows of
// the result, transposing in registers where the matrix is read along its rows. Two vectors are the
// columns of a matrix without padding; they are taken apart on loading, and every line of the block
// serves both. block_columns.h has the same for more columns; each element sees the same chain of
// operations in both.
//
// `ahead` is how far away from what is read memory is asked for: a solution reads the factors once
// from one end to the other and back, and waits for nothing else.
#pragma once

#include "trajopt/linalg/block_kernels.h"
#include "trajopt/linalg/tile.h"

namespace trajopt::linalg::inline TRAJOPT_ISA {

// kWidth rows of M columns, each column a vector.
template <class T, int M>
struct RowsOf {
  static constexpr int W = kWidth<T>;
  Vec<T> a[M];

  // The first `rows` of them exist.
  TRAJOPT_ALWAYS_INLINE void read(const T* x, int rows) {
    if constexpr (M == 1) {
      a[0] = rows == W ? load(x) : load(x, rows);
    } else if (rows == W) {
      a[0] = load(x), a[1] = load(x + W);
      separate(a[0], a[1]);
    } else {
      const int first = 2 * rows < W ? 2 * rows : W;
      a[0] = load(x, first), a[1] = load(x + W, 2 * rows - first);
      separate(a[0], a[1]);
    }
  }
  TRAJOPT_ALWAYS_INLINE void write(T* x, int rows) const {
    if constexpr (M == 1) {
      rows == W ? store(x, a[0]) : store(x, a[0], rows);
    } else {
      Vec<T> low = a[0], high = a[1];
      interleave(low, high);
      if (rows == W) {
        store(x, low), store(x + W, high);
      } else {
        const int first = 2 * rows < W ? 2 * rows : W;
        store(x, low, first), store(x + W, high, 2 * rows - first);
      }
    }
  }

  // Minus v times a row x of M numbers.
  TRAJOPT_ALWAYS_INLINE void subtract(const T* x, Vec<T> v) {
#pragma GCC unroll 2
    for (int j = 0; j < M; ++j) a[j] = fnma(broadcast(x[j]), v, a[j]);
  }
};

// The `size` rows of x times d. In vectors: where numbers one by one were stored, the vectors that
// are read next would have to wait.
template <int M, class T>
inline void scale_few(int size, const T* d, T* x) {
  constexpr int W = kWidth<T>;
  for (int k = 0; k < size; k += W) {
    const int rows = size - k < W ? size - k : W;
    const Vec<T> factor = rows == W ? load(d + k) : load(d + k, rows);
    RowsOf<T, M> row;
    row.read(x + k * M, rows);
#pragma GCC unroll 2
    for (int j = 0; j < M; ++j) row.a[j] = mul(row.a[j], factor);
    row.write(x + k * M, rows);
  }
}

// W rows of a block, of which `rows` exist; asks for the lines `ahead` elements away.
template <class T>
TRAJOPT_ALWAYS_INLINE void load_square(const T* square, long ld, int rows, long ahead,
                                       Vec<T> (&t)[kWidth<T>]) {
  constexpr int W = kWidth<T>;
  if (rows == W) {
#pragma GCC unroll 16
    for (int r = 0; r < W; ++r) {
      prefetch_second(square + r * ld + ahead);
      t[r] = load(square + r * ld);
    }
  } else {
#pragma GCC unroll 16
    for (int r = 0; r < W; ++r) {
      t[r] = broadcast(T(0));
      if (r >= rows) continue;
      prefetch_second(square + r * ld + ahead);
      t[r] = load(square + r * ld);
    }
  }
}

// y[0..columns) -= Vt x for `rows` rows of V, the last one first.
template <int M, class T>
inline void subtract_transposed_few(int rows, int columns, const T* v, long ld, const T* x, T* y,
                                    long ahead) {
  constexpr int W = kWidth<T>, kMost = W * static_cast<int>(sizeof(T)) == 64 ? 8 : 8 / M;
  for (int c = 0; c < columns;) {
    const int left = vectors<T>(columns - c), nv = left < kMost ? left : kMost;
    const int tail = columns - c < nv * W ? columns - c - (nv - 1) * W : W;
    with_constant<kMost>(nv, [&]<int NV>() {
      RowsOf<T, M> sum[NV];
#pragma GCC unroll 8
      for (int i = 0; i < NV; ++i) sum[i].read(y + (c + i * W) * M, i == NV - 1 ? tail : W);
      for (int k = rows - 1; k >= 0; --k) {
        const T* row = v + k * ld + c;
#pragma GCC unroll 8
        for (int i = 0; i < NV; ++i) {
          if (i * W % kLine<T> == 0) prefetch_second(row + i * W + ahead);
          sum[i].subtract(x + k * M, load(row + i * W));
        }
      }
#pragma GCC unroll 8
      for (int i = 0; i < NV; ++i) sum[i].write(y + (c + i * W) * M, i == NV - 1 ? tail : W);
    });
    c += nv * W;
  }
}

// sum -= the `columns` <= W columns of a square, in ascending order, times as many rows of x.
template <class T, int M>
TRAJOPT_ALWAYS_INLINE void subtract_square(const T* square, long ld, int rows, int columns,
                                           const T* x, long ahead, RowsOf<T, M>& sum) {
  constexpr int W = kWidth<T>;
  Vec<T> t[W];
  load_square(square, ld, rows, ahead, t);
  transpose(t);
#pragma GCC unroll 16
  for (int j = 0; j < W; ++j) {
    if (columns == W || j < columns) sum.subtract(x + j * M, t[j]);
  }
}

// y[0..rows) -= V x for `columns` columns of V, the first one first. Two panels of rows at a time:
// one alone would wait for its chain of operations.
template <int M, class T>
inline void subtract_few(int rows, int columns, const T* v, long ld, const T* x, T* y, long ahead) {
  constexpr int W = kWidth<T>;
  const int whole_columns = columns / W * W, left = columns - whole_columns;
  int r0 = 0;
  for (; r0 + 2 * W <= rows; r0 += 2 * W) {
    RowsOf<T, M> sum[2];
    sum[0].read(y + r0 * M, W), sum[1].read(y + (r0 + W) * M, W);
    const T *first = v + r0 * ld, *second = first + W * ld;
    for (int c = 0; c < whole_columns; c += W) {
      subtract_square(first + c, ld, W, W, x + c * M, ahead, sum[0]);
      subtract_square(second + c, ld, W, W, x + c * M, ahead, sum[1]);
    }
    if (left > 0) {
      subtract_square(first + whole_columns, ld, W, left, x + whole_columns * M, ahead, sum[0]);
      subtract_square(second + whole_columns, ld, W, left, x + whole_columns * M, ahead, sum[1]);
    }
    sum[0].write(y + r0 * M, W), sum[1].write(y + (r0 + W) * M, W);
  }
  for (; r0 < rows; r0 += W) {
    const int height = rows - r0 < W ? rows - r0 : W;
    RowsOf<T, M> sum;
    sum.read(y + r0 * M, height);
    for (int c = 0; c < columns; c += W) {
      const int width = columns - c < W ? columns - c : W;
      subtract_square(v + r0 * ld + c, ld, height, width, x + c * M, ahead, sum);
    }
    sum.write(y + r0 * M, height);
  }
}

// Panels of W columns of the packed W, the last one first.
template <int M, class T>
inline void substitute_transposed_few(int size, const T* packed, T* x, long ahead) {
  constexpr int W = kWidth<T>, L = kLine<T>;
  for (int c = (size - 1) / W * W; c >= 0; c -= W) {
    const int height = size - c < W ? size - c : W;
    const T* corner = packed + PackedTriangle<T>::at(size, c, c);
    RowsOf<T, M> sum;
    sum.read(x + c * M, height);
    for (int k = size - 1; k >= c + W; --k) {
      const T* row = corner + (k - c) * static_cast<long>(L);
      prefetch_second(row + ahead);
      sum.subtract(x + k * M, load(row));
    }
#pragma GCC unroll 16
    for (int r = W - 1; r > 0; --r) {
      prefetch_second(corner + r * L + ahead);
      if (r >= height) continue;
      const Vec<T> row = load(corner + r * L);
#pragma GCC unroll 2
      for (int j = 0; j < M; ++j) {
        sum.a[j] = fnma_first(r, broadcast_lane(sum.a[j], r), row, sum.a[j]);
      }
    }
    prefetch_second(corner + ahead);
    sum.write(x + c * M, height);
  }
}

// x = (the square of W on its diagonal)^-1 x for `height` rows.
template <class T, int M>
TRAJOPT_ALWAYS_INLINE void substitute_square(const T* square, int height, long ahead,
                                             RowsOf<T, M>& x) {
  constexpr int W = kWidth<T>;
  Vec<T> t[W];
  load_square(square, kLine<T>, W, ahead, t);
  transpose(t);
#pragma GCC unroll 16
  for (int s = 0; s + 1 < W; ++s) {
    if (s + 1 >= height) continue;
#pragma GCC unroll 2
    for (int j = 0; j < M; ++j) {
      x.a[j] = fnma_from(s + 1, broadcast_lane(x.a[j], s), t[s], x.a[j]);
    }
  }
}

// The packed W in the order in which it lies in memory: columns, from each its rows downwards. Of
// `Panels` panels of W rows, which stay in registers.
template <int M, int Panels, class T>
TRAJOPT_ALWAYS_INLINE void substitute_panels(int size, const T* packed, T* x, long ahead) {
  constexpr int W = kWidth<T>, L = kLine<T>;
  const int tail = size - (Panels - 1) * W;
  RowsOf<T, M> sum[Panels];
#pragma GCC unroll 4
  for (int p = 0; p < Panels; ++p) sum[p].read(x + p * W * M, p == Panels - 1 ? tail : W);
#pragma GCC unroll 4
  for (int p = 0; p < Panels; ++p) {
    const int c = p * W, height = p == Panels - 1 ? tail : W;
    substitute_square(packed + PackedTriangle<T>::at(size, c, c), height, ahead, sum[p]);
    sum[p].write(x + c * M, height);
#pragma GCC unroll 4
    for (int q = p + 1; q < Panels; ++q) {
      subtract_square(packed + PackedTriangle<T>::at(size, q * W, c), L, W, W, x + c * M, ahead,
                      sum[q]);
    }
  }
}

template <int M, class T>
inline void substitute_few(int size, const T* packed, T* x, long ahead) {
  constexpr int W = kWidth<T>, L = kLine<T>, kMost = 4;
  if (size <= kMost * W) {
    return with_constant<kMost>(vectors<T>(size), [&]<int Panels>() {
      substitute_panels<M, Panels>(size, packed, x, ahead);
    });
  }
  for (int r0 = 0; r0 < size; r0 += W) {
    const int height = size - r0 < W ? size - r0 : W;
    RowsOf<T, M> sum;
    sum.read(x + r0 * M, height);
    for (int c = 0; c < r0; c += W) {
      subtract_square(packed + PackedTriangle<T>::at(size, r0, c), L, W, W, x + c * M, ahead, sum);
    }
    substitute_square(packed + PackedTriangle<T>::at(size, r0, r0), height, ahead, sum);
    sum.write(x + r0 * M, height);
  }
}

// y -= A x with the lower triangle of A, read once: the square of rows r and columns c serves
// y[r..) and, transposed, y[c..). Columns ascend for both.
template <int M, class T>
inline void subtract_symmetric_few(int size, const T* a, long ld, const T* x, T* y, long ahead) {
  constexpr int W = kWidth<T>;
  for (int c = 0; c < size; c += W) {
    const int width = size - c < W ? size - c : W;
    RowsOf<T, M> sum;
    sum.read(y + c * M, width);
    Vec<T> t[W], rows[W];
    load_square(a + c * ld + c, ld, width, ahead, rows);
#pragma GCC unroll 16
    for (int r = 0; r < W; ++r) t[r] = rows[r];
    transpose(t);
#pragma GCC unroll 16
    for (int j = 0; j < W; ++j) {
      if (j < width) sum.subtract(x + (c + j) * M, select_first(j, rows[j], t[j]));
    }
    for (int r = c + W; r < size; r += W) {
      const int height = size - r < W ? size - r : W;
      RowsOf<T, M> below;
      below.read(y + r * M, height);
      load_square(a + r * ld + c, ld, height, ahead, t);
#pragma GCC unroll 16
      for (int j = 0; j < W; ++j) {
        if (height == W || j < height) sum.subtract(x + (r + j) * M, t[j]);
      }
      transpose(t);
#pragma GCC unroll 16
      for (int j = 0; j < W; ++j) below.subtract(x + (c + j) * M, t[j]);
      below.write(y + r * M, height);
    }
    sum.write(y + c * M, width);
  }
}

}  // namespace trajopt::linalg::inline TRAJOPT_ISA
