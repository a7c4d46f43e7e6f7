// Elimination of one block with its couplings by a group of threads: A = Wt D W, U = W^-T S and
// V = D^-1 U, with the bits of the SIMD kernel, in the scalar type T of the factors.
//
// Panels of kPanel rows, the last one first. Every column of the trapezoid (block | left coupling |
// right coupling) is one chain per element, computed by one rank in registers from the rows below.
// Three phases a panel:
//
//   columns of the block left of the panel
//   the block on the diagonal of the next panel (its "corner") from the rows below; staging of W
//   rank 0 factors that corner, a serial chain of divisions, while the other warps compute the
//     couplings' columns of this panel
//
// Floor for a block of size B with both couplings, cold caches: 19/3 B^3 flops with its share of
// the updates, of which 7/3 B^3 here; 3 B^2 numbers read, 5 B^2 written.
#pragma once

#include <cstddef>

#include "trajopt/base/group.h"
#include "trajopt/linalg/block_source.h"
#include "trajopt/linalg/pivot.h"

namespace trajopt::linalg::inline TRAJOPT_ISA {

// c - a*b with one rounding.
TRAJOPT_HD inline double minus_product(double c, double a, double b) {
  return __builtin_fma(-a, b, c);
}
TRAJOPT_HD inline float minus_product(float c, float a, float b) {
  return __builtin_fmaf(-a, b, c);
}

namespace group {

inline constexpr int kPanel = 8;    // rows
inline constexpr int kColumns = 2;  // a rank computes at a time
inline constexpr int kWarp = 32;

// Element (k, j) of a coupling is source[k * row + j * column]: a transposed one is read in place.
template <class T>
struct BasicCoupling {
  BlockSource<T> source;
  long row = 0, column = 0;
  T* v = nullptr;  // may be the source
  T* u = nullptr;  // nullptr: there is no such neighbour
};

template <class T>
struct BasicElimination {
  int size = 0;
  long ld = 0;              // of w, u and the couplings' v and u
  BlockSource<T> diagonal;  // lower triangle; may be w
  long diagonal_ld = 0;
  const double* original = nullptr;    // the block before any update, leading dimension `size`
  const signed char* signs = nullptr;  // nullptr: all positive
  double regularization = 0.0;
  T* w = nullptr;        // out: its strict lower triangle
  T* u = nullptr;        // scratch: D W
  T* inverse = nullptr;  // out: the diagonal of D^-1
  BasicCoupling<T> left, right;
};

template <class T>
struct alignas(16) PanelRow {
  T v[kPanel];
};

template <class T>
struct Corner {
  T u[kPanel][kPanel];
  T w[kPanel][kPanel];
  T inverse[kPanel];
};

struct FailedPivot {
  int row;  // -1: none
  double value;
};

// What the ranks share; shared memory on a GPU.
template <class T>
struct BasicEliminationSpace {
  Corner<T>* corners;
  FailedPivot* failed;
  PanelRow<T>* rows;
  int size;

  TRAJOPT_HD BasicEliminationSpace(void* memory, int size_of_block)
      : corners(static_cast<Corner<T>*>(memory)),
        failed(reinterpret_cast<FailedPivot*>(corners + 2)),
        rows(reinterpret_cast<PanelRow<T>*>(failed + 1)),
        size(size_of_block) {
    static_assert((2 * sizeof(Corner<T>) + sizeof(FailedPivot)) % alignof(PanelRow<T>) == 0);
  }
  static constexpr std::size_t bytes(int size) {
    return 2 * sizeof(Corner<T>) + sizeof(FailedPivot) + 2 * sizeof(PanelRow<T>) * size;
  }

  // Two panels are in work at a time.
  TRAJOPT_HD Corner<T>& corner(int panel) const { return corners[panel % 2]; }
  // Row q holds w[q][first row of the panel + r]; zeros behind the panel's last row.
  TRAJOPT_HD PanelRow<T>* w(int panel) const { return rows + panel % 2 * static_cast<long>(size); }
};

using Elimination = BasicElimination<double>;
using EliminationSpace = BasicEliminationSpace<double>;

// Element (i, j) of the corner of the panel that starts at row k0, from the rows behind `end`.
template <class T>
TRAJOPT_HD inline T corner_element(const BasicElimination<T>& e, int k0, int end, int i, int j) {
  T a = e.diagonal[(k0 + i) * e.diagonal_ld + k0 + j];
  for (int q = e.size - 1; q >= end; --q) {
    a = minus_product(a, e.w[q * e.ld + k0 + i], e.u[q * e.ld + k0 + j]);
  }
  return a;
}

// Factors the corner of `rows` rows in registers; writes its part of W. One rank's work.
template <class T>
TRAJOPT_HD inline void factor_corner(const BasicElimination<T>& e, int k0, int rows,
                                     Corner<T>& corner, FailedPivot& failed) {
  const T regularization = static_cast<T>(e.regularization);
  T u[kPanel][kPanel];
  TRAJOPT_UNROLL
  for (int r = 0; r < kPanel; ++r) {
    TRAJOPT_UNROLL
    for (int s = 0; s <= r; ++s) u[r][s] = r < rows ? corner.u[r][s] : T(0);
  }
  TRAJOPT_UNROLL
  for (int r = kPanel - 1; r >= 0; --r) {
    if (r < rows) {
      const int k = k0 + r;
      const T sign = e.signs ? static_cast<T>(e.signs[k]) : T(1);
      // Added to a zero, -0 does not change its sign.
      const T shift = e.regularization != 0.0 ? sign * regularization : T(-0.0);
      const T d = u[r][r] + shift;
      const T inverse = T(1) / d;
      const T before = static_cast<T>(e.original[k * (e.size + 1L)]) + shift;
      if (!pivot_is_good(d, inverse, sign, before)) {
        failed.row = k;
        failed.value = d;
        return;
      }
      corner.inverse[r] = e.inverse[k] = inverse;
      TRAJOPT_UNROLL
      for (int s = r - 1; s >= 0; --s) {
        const T w = u[r][s] * inverse;
        corner.w[r][s] = e.w[k * e.ld + k0 + s] = w;
        TRAJOPT_UNROLL
        for (int j = 0; j <= s; ++j) u[s][j] = minus_product(u[s][j], w, u[r][j]);
      }
    }
  }
}

// Where the columns of a part of the trapezoid come from and go to.
template <class T>
struct Columns {
  BlockSource<T> source;
  long row, column;
  T *v, *u;
};

// Rows k0 .. k0 + rows - 1 of N columns, given as pointers to each column's part and its index
// there. Full: rows == kPanel.
template <bool Full, class T, int N>
TRAJOPT_HD inline void eliminate_columns(const BasicElimination<T>& e, int k0, int rows,
                                         const Corner<T>& corner, const PanelRow<T>* w,
                                         const Columns<T> (&part)[N], const int (&c)[N]) {
  T a[kPanel][N];
  const auto has = [&](int r) { return Full || r < rows; };
  TRAJOPT_UNROLL
  for (int r = 0; r < kPanel; ++r) {
    TRAJOPT_UNROLL
    for (int n = 0; n < N; ++n) {
      a[r][n] = has(r) ? part[n].source[(k0 + r) * part[n].row + c[n] * part[n].column] : T(0);
    }
  }
  const T* u[N];
  for (int n = 0; n < N; ++n) u[n] = part[n].u + (e.size - 1) * e.ld + c[n];
  for (int q = e.size - 1; q >= k0 + rows; --q) {
    const PanelRow<T> factor = w[q];
    TRAJOPT_UNROLL
    for (int n = 0; n < N; ++n) {
      const T b = *u[n];
      u[n] -= e.ld;
      TRAJOPT_UNROLL
      for (int r = 0; r < kPanel; ++r) a[r][n] = minus_product(a[r][n], factor.v[r], b);
    }
  }
  TRAJOPT_UNROLL
  for (int r = kPanel - 1; r >= 0; --r) {
    if (!has(r)) continue;
    TRAJOPT_UNROLL
    for (int n = 0; n < N; ++n) {
      TRAJOPT_UNROLL
      for (int s = 0; s < r; ++s) a[s][n] = minus_product(a[s][n], corner.w[r][s], a[r][n]);
      part[n].u[(k0 + r) * e.ld + c[n]] = a[r][n];
      part[n].v[(k0 + r) * e.ld + c[n]] = a[r][n] * corner.inverse[r];
    }
  }
}

// This rank's share of `count` columns, dealt out to the ranks from `first` on.
template <class T, class PartOf>
TRAJOPT_HD inline void eliminate_share(const BasicElimination<T>& e, int k0, int rows,
                                       const Corner<T>& corner, const PanelRow<T>* w, int worker,
                                       int workers, int count, const PartOf& part_of) {
  for (int i = worker; i < count; i += kColumns * workers) {
    int c[kColumns] = {i, i + workers};
    if (c[1] < count) {
      const Columns<T> part[] = {part_of(c[0]), part_of(c[1])};
      if (rows == kPanel) {
        eliminate_columns<true>(e, k0, rows, corner, w, part, c);
      } else {
        eliminate_columns<false>(e, k0, rows, corner, w, part, c);
      }
    } else {
      int only[1] = {i};
      const Columns<T> part[] = {part_of(only[0])};
      eliminate_columns<false>(e, k0, rows, corner, w, part, only);
    }
  }
}

// Returns the failing row, whose pivot is then in space.failed, or -1; the same to every rank. The
// group may reuse the space after its next barrier.
template <class Group, class T>
TRAJOPT_HD inline int eliminate(const Group& group, const BasicElimination<T>& e,
                                const BasicEliminationSpace<T>& space) {
  const int size = e.size;
  const int couplings = (e.left.u ? size : 0) + (e.right.u ? size : 0);
  const auto block_part = [&](int&) { return Columns<T>{e.diagonal, e.diagonal_ld, 1, e.w, e.u}; };
  // Columns of the couplings are numbered through; `c` becomes the index in its own.
  const auto coupling_part = [&](int& c) {
    const bool left = e.left.u && c < size;
    if (!left && e.left.u) c -= size;
    const BasicCoupling<T>& s = left ? e.left : e.right;
    return Columns<T>{s.source, s.row, s.column, s.v, s.u};
  };

  int end = size, panel = 0;
  const auto height = [](int rows) { return rows < kPanel ? rows : kPanel; };
  // The corner of the panel that ends at `last`, and the rows of W that its columns need.
  const auto prepare = [&](int last, int index, int rank) {
    const int rows = height(last), k0 = last - rows;
    for (int t = rank; t < rows * rows; t += group.size()) {
      const int i = t / rows, j = t % rows;
      if (j <= i) space.corner(index).u[i][j] = corner_element(e, k0, last, i, j);
    }
    for (int t = rank; t < (size - last) * kPanel; t += group.size()) {
      const int q = last + t / kPanel, r = t % kPanel;
      space.w(index)[q].v[r] = r < rows ? e.w[q * e.ld + k0 + r] : T(0);
    }
  };
  const auto factor = [&](int last, int index) {
    factor_corner(e, last - height(last), height(last), space.corner(index), *space.failed);
  };

  group.phase([&](int rank) {
    if (rank == 0) space.failed->row = -1;
    prepare(end, panel, rank);
  });
  group.phase([&](int rank) {
    if (rank == 0) factor(end, panel);
  });
  while (end > 0) {
    if (space.failed->row >= 0) return space.failed->row;
    const int rows = height(end), k0 = end - rows;
    const Corner<T>& corner = space.corner(panel);
    const PanelRow<T>* w = space.w(panel);
    group.phase([&](int rank) {
      eliminate_share(e, k0, rows, corner, w, rank, group.size(), k0, block_part);
    });
    if (k0 > 0) group.phase([&](int rank) { prepare(k0, panel + 1, rank); });
    // The first warp is busy with the corner, if there are others.
    const int first = k0 > 0 && group.size() > kWarp ? kWarp : 0;
    group.phase([&](int rank) {
      if (rank == 0 && k0 > 0) factor(k0, panel + 1);
      if (rank >= first) {
        eliminate_share(e, k0, rows, corner, w, rank - first, group.size() - first, couplings,
                        coupling_part);
      }
    });
    end = k0;
    ++panel;
  }
  return space.failed->row;
}

}  // namespace group

}  // namespace trajopt::linalg::inline TRAJOPT_ISA
