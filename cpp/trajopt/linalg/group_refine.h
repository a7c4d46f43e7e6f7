// The launches of iterative refinement: of residuals in float64, whatever the factors are. Which
// columns go on is decided where the residual is, so that a device needs no answer from the host.
#pragma once

#include "trajopt/linalg/group_work.h"

namespace trajopt::linalg::inline TRAJOPT_ISA::group {

// A chunk of columns' part of max |.|: reduced in the group, then among the groups. Every
// `stride`-th of the values counts.
template <class Group>
TRAJOPT_HD inline void raise_norm(const Group& group, const double* values, int count,
                                  double* peaks, double* norm, int stride = 1) {
  group.phase([&](int rank) {
    double most = 0.0;
    for (int i = rank; i < count; i += group.size()) {
      const double value = values[i * stride];
      most = largest(most, value < 0.0 ? -value : value);
    }
    peaks[rank] = most;
  });
  group.phase([&](int rank) {
    if (rank >= kWarp) return;
    for (int i = rank + kWarp; i < group.size(); i += kWarp) {
      peaks[rank] = largest(peaks[rank], peaks[i]);
    }
  });
  group.phase([&](int rank) {
    if (rank != 0) return;
    double most = 0.0;
    for (int i = 0; i < kWarp && i < group.size(); ++i) most = largest(most, peaks[i]);
    group.raise(norm, most);
  });
}

// r = rhs - A x and max |r| per item and chunk; without x: max |rhs| alone.
struct ResidualWork {
  static constexpr const char* kName = "residual";
  static constexpr int kMaxRanks = 256;
  GroupMatrix s;
  GroupVectors v;  // x, or nullptr
  const double* rhs;
  double* r;
  double* norm;  // (batch, chunks)

  TRAJOPT_HD long jobs() const { return vector_jobs(s.blocks, s, v.m); }
  TRAJOPT_HD int ranks() const { return vector_ranks(s.size, v.m); }
  std::size_t bytes() const {
    return VectorSpace<double>::bytes(s.size, false) + sizeof(double) * kMaxRanks;
  }

  template <class Group>
  TRAJOPT_HD void operator()(const Group& group, long number, void* memory) const {
    const VectorJob job(number, s.blocks, s, v);
    if (job.skipped) return;
    double* peaks = static_cast<double*>(memory);
    const VectorSpace<double> space(peaks + kMaxRanks, s.size);
    const int i = job.entry, n = s.size, columns = job.columns;
    const long at =
        (static_cast<long>(job.item) * s.blocks + i) * n * v.m + job.chunk * kGroupColumns;
    copy_columns(group, n, rhs + at, v.m, space.x, columns, columns);
    if (v.x) {
      const auto x = [&](int block) { return job.part(s, v.x, block, v.m); };
      if (i > 0) {
        subtract(group, n, n, s.lower_of(job.item, i - 1), n, x(i - 1), space.x, columns, v.m,
                 columns, space.operations);
      }
      subtract_symmetric(group, n, s.diagonal_of(job.item, i), n, x(i), space.x, columns, v.m,
                         columns, space.operations);
      if (i + 1 < s.blocks) {
        subtract_transposed(group, n, n, s.lower_of(job.item, i), n, x(i + 1), space.x, columns,
                            v.m, columns);
      }
      copy_columns(group, n, space.x, columns, r + at, v.m, columns);
    }
    const long lane = static_cast<long>(job.item) * column_chunks(v.m) + job.chunk;
    raise_norm(group, space.x, n * columns, peaks, norm + lane);
  }
};

// What follows from a new residual, for every item and chunk: the decisions of refine_loop().
struct DecideWork {
  static constexpr const char* kName = "decide";
  static constexpr int kMaxRanks = 256;
  enum class When { scale, start, step };
  When when;
  GroupMatrix s;
  int chunks;  // of an item's columns
  int max_steps;
  double tolerance;
  double* norm;  // set back to zero
  GroupRefinement* states;
  int* active;

  TRAJOPT_HD long lanes() const { return static_cast<long>(s.batch) * chunks; }
  TRAJOPT_HD long jobs() const { return (lanes() + kMaxRanks - 1) / kMaxRanks; }
  TRAJOPT_HD int ranks() const { return kMaxRanks; }
  std::size_t bytes() const { return 0; }

  template <class Group>
  TRAJOPT_HD void operator()(const Group& group, long job, void*) const {
    for_each(group, kMaxRanks, [&](int at) {
      const long place = job * kMaxRanks + at;
      const int item = place < lanes() ? s.item_at(static_cast<int>(place / chunks)) : -1;
      if (item < 0) return;
      decide(static_cast<long>(item) * chunks + place % chunks);
    });
  }

  TRAJOPT_HD void decide(long lane) const {
    GroupRefinement& state = states[lane];
    const double measured = norm[lane];
    norm[lane] = 0.0;
    if (when == When::scale) {
      state = {0.0, measured > 0.0 ? measured : 1.0, 0, false};
      active[lane] = 1;
    } else if (when == When::start) {
      state.residual = measured / state.scale;
      active[lane] = goes_on(state);
    } else if (active[lane]) {
      const double residual = measured / state.scale;
      state.undo = !(residual < 2.0 * state.residual);
      if (state.undo) {
        active[lane] = 0;
        return;
      }
      const bool halved = residual <= 0.5 * state.residual;
      state.residual = residual;
      ++state.steps;
      active[lane] = halved && goes_on(state);
    } else {
      state.undo = false;
    }
  }

  TRAJOPT_HD bool goes_on(const GroupRefinement& state) const {
    return state.steps < max_steps && !(state.residual <= tolerance);
  }
};

// saved = x, x += r for the columns that go on; or x = saved where that was a step too far.
struct CorrectWork {
  static constexpr const char* kName = "correct";
  static constexpr int kMaxRanks = 256;
  GroupMatrix s;
  GroupVectors v;
  const double* r;
  double* saved;
  const GroupRefinement* states;  // nullptr: correct; else undo

  TRAJOPT_HD long jobs() const { return vector_jobs(s.blocks, s, v.m); }
  TRAJOPT_HD int ranks() const {
    const int count = s.size * (v.m < kGroupColumns ? v.m : kGroupColumns);
    return warps(count < kMaxRanks ? count : kMaxRanks);
  }
  std::size_t bytes() const { return 0; }

  template <class Group>
  TRAJOPT_HD void operator()(const Group& group, long number, void*) const {
    const VectorJob job(number, s.blocks, s, v);
    if (job.item < 0) return;
    const long lane = static_cast<long>(job.item) * column_chunks(v.m) + job.chunk;
    if (states ? !states[lane].undo : job.skipped) return;
    const long begin = (static_cast<long>(job.item) * s.blocks + job.entry) * s.size * v.m +
                       job.chunk * kGroupColumns;
    for_each(group, s.size * job.columns, [&](int t) {
      const int i = t / job.columns, j = t - i * job.columns;
      const long at = begin + static_cast<long>(i) * v.m + j;
      if (states) {
        v.x[at] = saved[at];
      } else {
        saved[at] = v.x[at];
        v.x[at] += r[at];
      }
    });
  }
};

}  // namespace trajopt::linalg::inline TRAJOPT_ISA::group
