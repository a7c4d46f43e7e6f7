// Around a solution with float32 factors: right-hand sides are rounded and solutions widened, each
// column scaled by a power of two, as Factorization::solve does. Floor: the three launches read and
// write 32 bytes an element between them.
#pragma once

#include "trajopt/linalg/column_scale.h"
#include "trajopt/linalg/group_work.h"

namespace trajopt::linalg::inline TRAJOPT_ISA::group {

inline constexpr int kRoundRows = 512;  // of a job at most

// Some rows of up to kGroupColumns columns of an item: an entry of VectorJob, whatever the blocks.
struct RoundJob : VectorJob {
  int rows;
  long at;      // in (batch, blocks * size, m), the first element
  long column;  // in (batch, m), the first column
  TRAJOPT_HD RoundJob(long job, const GroupMatrix& s, const GroupVectors& v)
      : VectorJob(job, parts(s), s, v) {
    const long all = static_cast<long>(s.blocks) * s.size;
    const long row = static_cast<long>(entry) * kRoundRows;
    rows = static_cast<int>(all - row < kRoundRows ? all - row : kRoundRows);
    column = static_cast<long>(item) * v.m + chunk * kGroupColumns;
    at = (item * all + row) * v.m + chunk * kGroupColumns;
  }

  // body(index in (batch, blocks * size, m), index in (batch, m)) for every element.
  template <class Group, class Body>
  TRAJOPT_HD void each(const Group& group, int m, const Body& body) const {
    for_each(group, rows * columns, [&](int t) {
      const int i = t / columns, j = t - i * columns;
      body(at + static_cast<long>(i) * m + j, column + j);
    });
  }
  // body(index in (batch, m)) once for every column of all jobs.
  template <class Group, class Body>
  TRAJOPT_HD void each_column(const Group& group, const Body& body) const {
    if (entry == 0) for_each(group, columns, [&](int j) { body(column + j); });
  }

  TRAJOPT_HD static int parts(const GroupMatrix& s) {
    return static_cast<int>((static_cast<long>(s.blocks) * s.size + kRoundRows - 1) / kRoundRows);
  }
  TRAJOPT_HD static long count(const GroupMatrix& s, int m) { return vector_jobs(parts(s), s, m); }
  TRAJOPT_HD static int ranks(const GroupMatrix& s, int m) {
    const long all = static_cast<long>(s.blocks) * s.size * (m < kGroupColumns ? m : kGroupColumns);
    return warps(all < 256 ? static_cast<int>(all) : 256);
  }
};

// The largest magnitude of every column.
struct PeakWork {
  static constexpr const char* kName = "peak";
  static constexpr int kMaxRanks = 256;
  GroupMatrix s;
  GroupVectors v;
  double* peak;  // (batch, m); zero on entry

  TRAJOPT_HD long jobs() const { return RoundJob::count(s, v.m); }
  TRAJOPT_HD int ranks() const { return RoundJob::ranks(s, v.m); }
  std::size_t bytes() const { return sizeof(double) * kMaxRanks; }

  template <class Group>
  TRAJOPT_HD void operator()(const Group& group, long number, void* memory) const {
    const RoundJob job(number, s, v);
    if (job.skipped) return;
    double* most = static_cast<double*>(memory);
    const int columns = job.columns;
    // Every column is cut into as many parts, which are then folded in halves.
    int parts = group.size() > columns ? group.size() / columns : 1;
    for_each(group, parts * columns, [&](int at) {
      double a = 0.0;
      for (int i = at / columns; i < job.rows; i += parts) {
        const double x = v.x[job.at + static_cast<long>(i) * v.m + at % columns];
        a = largest(a, x < 0.0 ? -x : x);
      }
      most[at] = a;
    });
    while (parts > 1) {
      const int half = (parts + 1) / 2;
      for_each(group, (parts - half) * columns,
               [&](int at) { most[at] = largest(most[at], most[at + half * columns]); });
      parts = half;
    }
    for_each(group, columns, [&](int j) { group.raise(peak + job.column + j, most[j]); });
  }
};

// The columns divided by their scales, in float32.
struct RoundWork {
  static constexpr const char* kName = "round";
  static constexpr int kMaxRanks = 256;
  GroupMatrix s;
  GroupVectors v;
  GroupRounding room;

  TRAJOPT_HD long jobs() const { return RoundJob::count(s, v.m); }
  TRAJOPT_HD int ranks() const { return RoundJob::ranks(s, v.m); }
  std::size_t bytes() const { return 0; }

  template <class Group>
  TRAJOPT_HD void operator()(const Group& group, long number, void*) const {
    const RoundJob job(number, s, v);
    if (job.skipped) return;
    job.each(group, v.m, [&](long at, long column) {
      room.x[at] = static_cast<float>(v.x[at] / column_scale(room.peak[column]));
    });
    job.each_column(group, [&](long at) { room.scale[at] = column_scale(room.peak[at]); });
  }
};

// The solutions, and the peaks set back to zero.
struct RestoreWork {
  static constexpr const char* kName = "restore";
  static constexpr int kMaxRanks = 256;
  GroupMatrix s;
  GroupVectors v;
  GroupRounding room;

  TRAJOPT_HD long jobs() const { return RoundJob::count(s, v.m); }
  TRAJOPT_HD int ranks() const { return RoundJob::ranks(s, v.m); }
  std::size_t bytes() const { return 0; }

  template <class Group>
  TRAJOPT_HD void operator()(const Group& group, long number, void*) const {
    const RoundJob job(number, s, v);
    if (job.skipped) return;
    job.each(group, v.m, [&](long at, long column) {
      v.x[at] = static_cast<double>(room.x[at]) * room.scale[column];
    });
    job.each_column(group, [&](long at) { room.peak[at] = 0.0; });
  }
};

}  // namespace trajopt::linalg::inline TRAJOPT_ISA::group
