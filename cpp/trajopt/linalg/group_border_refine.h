// The launches of iterative refinement with a border, as BorderedFactorization::refine: every
// column takes its own decisions. Vectors are (batch, rows + border, m).
#pragma once

#include "trajopt/linalg/group_border.h"
#include "trajopt/linalg/group_refine.h"

namespace trajopt::linalg {

// Arrays of a refinement; a lane is a column of an item.
struct BorderRefineArrays {
  const double* rhs;
  double* r;
  double* saved;
  double* norm;             // (batch, m); zero on entry and on return
  GroupRefinement* states;  // (batch, m)
  int* active;              // (batch, m)
  int* going;               // (batch, column_chunks(m)): is any column of the chunk active?
};

}  // namespace trajopt::linalg

namespace trajopt::linalg::inline TRAJOPT_ISA::group {

// r = rhs - A x and max |r| per item and column; without x: max |rhs| alone. A job is a block of
// K's rows, or the border's.
struct BorderResidualWork {
  static constexpr const char* kName = "bordered residual";
  static constexpr int kMaxRanks = 256;
  GroupSystem s;
  GroupBorder b;
  GroupVectors v;  // x, or nullptr
  const double* rhs;
  double* r;
  double* norm;  // (batch, m)

  TRAJOPT_HD int entries() const { return s.blocks + 1; }
  TRAJOPT_HD int widest() const { return s.size > b.border ? s.size : b.border; }
  TRAJOPT_HD long jobs() const { return vector_jobs(entries(), s, v.m); }
  TRAJOPT_HD int ranks() const { return vector_ranks(widest(), v.m); }
  std::size_t bytes() const {
    return VectorSpace<double>::bytes(widest(), false) + sizeof(double) * kMaxRanks;
  }

  template <class Group>
  TRAJOPT_HD void operator()(const Group& group, long number, void* memory) const {
    const VectorJob job(number, entries(), s, v);
    if (job.skipped) return;
    double* peaks = static_cast<double*>(memory);
    const VectorSpace<double> space(peaks + kMaxRanks, widest());
    const int i = job.entry, columns = job.columns;
    const int n = i < s.blocks ? s.size : b.border;
    const long at = job.item * job.stride + static_cast<long>(i) * s.size * v.m +
                    static_cast<long>(job.chunk) * kGroupColumns;
    copy_columns(group, n, rhs + at, v.m, space.x, columns, columns);
    if (v.x) {
      if (i < s.blocks) {
        subtract_chain_row(group, job, space);
      } else {
        subtract_border_row(group, job, space);
      }
      copy_columns(group, n, space.x, columns, r + at, v.m, columns);
    }
    for (int j = 0; j < columns; ++j) {
      const long lane = static_cast<long>(job.item) * v.m + job.chunk * kGroupColumns + j;
      raise_norm(group, space.x + j, n, peaks, norm + lane, columns);
    }
  }

  template <class Group>
  TRAJOPT_HD void subtract_chain_row(const Group& group, const VectorJob& job,
                                     const VectorSpace<double>& space) const {
    const int i = job.entry, n = s.size, columns = job.columns;
    const auto x = [&](int block) { return job.part(s, v.x, block, v.m); };
    if (i > 0) {
      subtract(group, n, n, s.lower_of(job.item, i - 1), n, x(i - 1), space.x, columns, v.m,
               columns, space.operations);
    }
    subtract_symmetric(group, n, s.diagonal_of(job.item, i), n, x(i), space.x, columns, v.m,
                       columns, space.operations);
    if (i + 1 < s.blocks) {
      subtract_transposed(group, n, n, s.lower_of(job.item, i), n, x(i + 1), space.x, columns, v.m,
                          columns);
    }
    const long row = static_cast<long>(i) * n;
    if (row >= b.reached && row < b.rows - b.reached) return;  // E is zero there
    subtract(group, n, b.border, b.e_of(job.item) + row * b.border, b.border, x(s.blocks), space.x,
             columns, v.m, columns, space.operations);
  }

  template <class Group>
  TRAJOPT_HD void subtract_border_row(const Group& group, const VectorJob& job,
                                      const VectorSpace<double>& space) const {
    const int n = b.border, columns = job.columns;
    for (int p = 0; p < b.parts(); ++p) {
      const long first = b.part(p);
      subtract_transposed(group, static_cast<int>(b.reached), n, b.e_of(job.item) + first * n, n,
                          job.part(s, v.x, 0, v.m) + first * v.m, space.x, columns, v.m, columns);
    }
    subtract_symmetric(group, n, b.f_of(job.item), n, job.part(s, v.x, s.blocks, v.m), space.x,
                       columns, v.m, columns, space.operations);
  }
};

// The decisions of DecideWork for every column, a rank per item and chunk.
struct BorderDecideWork {
  static constexpr const char* kName = "bordered decide";
  static constexpr int kMaxRanks = 256;
  DecideWork by_column;  // its chunks are columns
  int* going;

  TRAJOPT_HD int chunks() const { return column_chunks(by_column.chunks); }
  TRAJOPT_HD long lanes() const { return static_cast<long>(by_column.s.batch) * chunks(); }
  TRAJOPT_HD long jobs() const { return (lanes() + kMaxRanks - 1) / kMaxRanks; }
  TRAJOPT_HD int ranks() const { return kMaxRanks; }
  std::size_t bytes() const { return 0; }

  template <class Group>
  TRAJOPT_HD void operator()(const Group& group, long job, void*) const {
    const int m = by_column.chunks;
    for_each(group, kMaxRanks, [&](int at) {
      const long place = job * kMaxRanks + at;
      const int item =
          place < lanes() ? by_column.s.item_at(static_cast<int>(place / chunks())) : -1;
      if (item < 0) return;
      const int chunk = static_cast<int>(place % chunks()), first = chunk * kGroupColumns;
      int any = 0;
      for (int j = first; j < m && j < first + kGroupColumns; ++j) {
        const long lane = static_cast<long>(item) * m + j;
        by_column.decide(lane);
        any |= by_column.active[lane];
      }
      going[static_cast<long>(item) * chunks() + chunk] = any;
    });
  }
};

// saved = x, x += r in the columns that go on; or x = saved where that was a step too far.
struct BorderCorrectWork {
  static constexpr const char* kName = "bordered correct";
  static constexpr int kMaxRanks = 256;
  GroupSystem s;
  GroupBorder b;
  GroupVectors v;
  BorderRefineArrays a;
  bool undo;

  TRAJOPT_HD long jobs() const { return vector_jobs(s.blocks + 1, s, v.m); }
  TRAJOPT_HD int ranks() const {
    const int widest = s.size > b.border ? s.size : b.border;
    const int count = widest * (v.m < kGroupColumns ? v.m : kGroupColumns);
    return warps(count < kMaxRanks ? count : kMaxRanks);
  }
  std::size_t bytes() const { return 0; }

  template <class Group>
  TRAJOPT_HD void operator()(const Group& group, long number, void*) const {
    const VectorJob job(number, s.blocks + 1, s, v);
    if (job.skipped) return;
    const int n = job.entry < s.blocks ? s.size : b.border;
    const long lane = static_cast<long>(job.item) * v.m + job.chunk * kGroupColumns;
    const long begin = job.item * job.stride + static_cast<long>(job.entry) * s.size * v.m +
                       static_cast<long>(job.chunk) * kGroupColumns;
    for_each(group, n * job.columns, [&](int t) {
      const int i = t / job.columns, j = t - i * job.columns;
      const long at = begin + static_cast<long>(i) * v.m + j;
      if (undo) {
        if (a.states[lane + j].undo) v.x[at] = a.saved[at];
      } else if (a.active[lane + j]) {
        a.saved[at] = v.x[at];
        v.x[at] += a.r[at];
      }
    });
  }
};

}  // namespace trajopt::linalg::inline TRAJOPT_ISA::group
