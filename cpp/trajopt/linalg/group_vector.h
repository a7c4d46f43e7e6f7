// Block times vectors by a group of threads: triangular substitution and products with size x m
// right-hand sides, with the bits of the SIMD kernels.
//
// A column's chain does not depend on m: a rank takes one row and up to kSide columns at a time.
// Matrices that are read along a row by one rank pass through shared memory, so that a warp reads
// whole cache lines. Each operation is bound by memory: B^2 numbers (B^2/2 a triangle) for 2 B^2 m
// flops.
#pragma once

#include "trajopt/base/group.h"
#include "trajopt/linalg/group_eliminate.h"

namespace trajopt::linalg::inline TRAJOPT_ISA::group {

inline constexpr int kSide = 4;         // right-hand sides of a rank
inline constexpr int kStageRows = 128;  // of a matrix in shared memory,
inline constexpr int kStageColumns = 16;
inline constexpr int kStageStride = kStageColumns + 1;  // a column's elements in different banks

template <class T = double>
TRAJOPT_HD constexpr std::size_t vector_bytes(int size) {
  const int rows = size < kStageRows ? size : kStageRows;
  return sizeof(T) * (rows < kPanel ? kPanel : rows) * kStageStride;
}

// body(row, first column, columns) for the elements of a rows x m matrix; rows of a warp are
// neighbours.
template <class Group, class Body>
TRAJOPT_HD inline void for_rows(const Group& group, int rows, int m, const Body& body) {
  const int parts = (m + kSide - 1) / kSide;
  for_each(group, rows * parts, [&](int at) {
    const int part = at / rows, j = part * kSide;
    body(at - part * rows, j, m - j < kSide ? m - j : kSide);
  });
}

// y[0..count) -= s(k) * x[k][0..count) for the `terms` values k = first, first + step, ...
template <class Scalar, class T>
TRAJOPT_HD inline void subtract_chain(int first, int step, int terms, const Scalar& scalar,
                                      const T* x, long ldx, T* y, int count) {
  T a[kSide];
  TRAJOPT_UNROLL
  for (int j = 0; j < kSide; ++j) a[j] = j < count ? y[j] : T(0);
  for (int t = 0, k = first; t < terms; ++t, k += step) {
    const T s = scalar(k);
    TRAJOPT_UNROLL
    for (int j = 0; j < kSide; ++j) {
      if (j < count) a[j] = minus_product(a[j], s, x[k * ldx + j]);
    }
  }
  TRAJOPT_UNROLL
  for (int j = 0; j < kSide; ++j) {
    if (j < count) y[j] = a[j];
  }
}

// y -= Vt x for the rows x columns matrix V, the last row first.
template <class Group, class T>
TRAJOPT_HD inline void subtract_transposed(const Group& group, int rows, int columns, const T* v,
                                           long ld, const T* x, T* y, int m, long ldx, long ldy) {
  for_rows(group, columns, m, [&](int i, int j, int count) {
    subtract_chain(
        rows - 1, -1, rows, [&](int k) { return v[k * ld + i]; }, x + j, ldx, y + i * ldy + j,
        count);
  });
}

// y -= A x for a rows x columns matrix given by its elements, the first column first. The element
// (i, k) is a[i * ld + k] where `along(i, k)`, else a[k * ld + i].
template <class Group, class Along, class T>
TRAJOPT_HD inline void subtract_staged(const Group& group, int rows, int columns, const T* a,
                                       long ld, const Along& along, const T* x, T* y, int m,
                                       long ldx, long ldy, T* space) {
  for (int i0 = 0; i0 < rows; i0 += kStageRows) {
    const int height = rows - i0 < kStageRows ? rows - i0 : kStageRows;
    for (int k0 = 0; k0 < columns; k0 += kStageColumns) {
      const int width = columns - k0 < kStageColumns ? columns - k0 : kStageColumns;
      group.phase([&](int rank) {
        // Along the rows first, then down the columns: each part in the order it lies in memory.
        for (int t = rank; t < height * width; t += group.size()) {
          const int i = t / width, k = t % width;
          if (along(i0 + i, k0 + k)) space[i * kStageStride + k] = a[(i0 + i) * ld + k0 + k];
        }
        for (int t = rank; t < height * width; t += group.size()) {
          const int k = t / height, i = t % height;
          if (!along(i0 + i, k0 + k)) space[i * kStageStride + k] = a[(k0 + k) * ld + i0 + i];
        }
      });
      for_rows(group, height, m, [&](int i, int j, int count) {
        const T* row = space + i * kStageStride;
        subtract_chain(
            0, 1, width, [&](int k) { return row[k]; }, x + k0 * ldx + j, ldx,
            y + (i0 + i) * ldy + j, count);
      });
    }
  }
}

// y -= V x for the rows x columns matrix V, the first column first.
template <class Group, class T>
TRAJOPT_HD inline void subtract(const Group& group, int rows, int columns, const T* v, long ld,
                                const T* x, T* y, int m, long ldx, long ldy, T* space) {
  subtract_staged(
      group, rows, columns, v, ld, [](int, int) { return true; }, x, y, m, ldx, ldy, space);
}

// y -= A x with the lower triangle of the symmetric A, the first column first.
template <class Group, class T>
TRAJOPT_HD inline void subtract_symmetric(const Group& group, int size, const T* a, long ld,
                                          const T* x, T* y, int m, long ldx, long ldy, T* space) {
  subtract_staged(
      group, size, size, a, ld, [](int i, int k) { return i >= k; }, x, y, m, ldx, ldy, space);
}

// x = W^-T x, the last row first, and x = W^-1 x, the first row first. A panel of kPanel rows is
// solved by one rank per column with a copy of its corner of W, then subtracted from the rows still
// to come. `space` holds that copy.
template <class Group, class T>
TRAJOPT_HD inline void substitute_transposed(const Group& group, int size, const T* w, long ld,
                                             T* x, int m, long ldx, T* space) {
  const auto stage_corner = [&](int end, int rank) {
    const int k0 = end < kPanel ? 0 : end - kPanel, rows = end - k0;
    for (int t = rank; t < rows * kPanel; t += group.size()) {
      const int r = t / kPanel, s = t % kPanel;
      if (s < r) space[t] = w[(k0 + r) * ld + k0 + s];
    }
  };
  group.phase([&](int rank) { stage_corner(size, rank); });
  for (int end = size; end > 0; end -= kPanel) {
    const int k0 = end < kPanel ? 0 : end - kPanel, rows = end - k0;
    for_each(group, m, [&](int j) {
      T a[kPanel];
      TRAJOPT_UNROLL
      for (int r = 0; r < kPanel; ++r) a[r] = r < rows ? x[(k0 + r) * ldx + j] : T(0);
      TRAJOPT_UNROLL
      for (int r = kPanel - 1; r > 0; --r) {
        if (r >= rows) continue;
        TRAJOPT_UNROLL
        for (int s = 0; s < r; ++s) a[s] = minus_product(a[s], space[r * kPanel + s], a[r]);
      }
      TRAJOPT_UNROLL
      for (int r = 0; r < kPanel; ++r) {
        if (r < rows) x[(k0 + r) * ldx + j] = a[r];
      }
    });
    if (k0 == 0) break;
    group.phase([&](int rank) { stage_corner(k0, rank); });
    for_rows(group, k0, m, [&](int i, int j, int count) {
      subtract_chain(
          end - 1, -1, rows, [&](int k) { return w[k * ld + i]; }, x + j, ldx, x + i * ldx + j,
          count);
    });
  }
}

template <class Group, class T>
TRAJOPT_HD inline void substitute(const Group& group, int size, const T* w, long ld, T* x, int m,
                                  long ldx, T* space) {
  const auto stage_corner = [&](int k0, int rank) {
    const int rows = size - k0 < kPanel ? size - k0 : kPanel;
    for (int t = rank; t < rows * kPanel; t += group.size()) {
      const int r = t / kPanel, s = t % kPanel;
      if (s < r) space[t] = w[(k0 + r) * ld + k0 + s];
    }
  };
  group.phase([&](int rank) { stage_corner(0, rank); });
  for (int k0 = 0; k0 < size; k0 += kPanel) {
    const int rows = size - k0 < kPanel ? size - k0 : kPanel, end = k0 + rows;
    for_each(group, m, [&](int j) {
      T a[kPanel];
      TRAJOPT_UNROLL
      for (int r = 0; r < kPanel; ++r) a[r] = r < rows ? x[(k0 + r) * ldx + j] : T(0);
      TRAJOPT_UNROLL
      for (int s = 0; s + 1 < kPanel; ++s) {
        TRAJOPT_UNROLL
        for (int r = s + 1; r < kPanel; ++r) {
          if (r < rows) a[r] = minus_product(a[r], space[r * kPanel + s], a[s]);
        }
      }
      TRAJOPT_UNROLL
      for (int r = 0; r < kPanel; ++r) {
        if (r < rows) x[(k0 + r) * ldx + j] = a[r];
      }
    });
    if (end == size) break;
    group.phase([&](int rank) { stage_corner(end, rank); });
    for_rows(group, size - end, m, [&](int i, int j, int count) {
      const T* row = w + (end + i) * ld;
      subtract_chain(
          k0, 1, rows, [&](int k) { return row[k]; }, x + j, ldx, x + (end + i) * ldx + j, count);
    });
  }
}

}  // namespace trajopt::linalg::inline TRAJOPT_ISA::group
