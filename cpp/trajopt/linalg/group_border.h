// The launches that a border of dense unknowns adds, as BorderedFactorization: the Schur complement
// S = F - Et K^-1 E, its elimination, and the border's part of a solution.
//
// Et Z and Et z are one chain per element over all rows of E that may not be zero: the definition
// leaves a device only the border's own columns to divide, so their floor is the latency of a chain
// of as many operations.
#pragma once

#include "trajopt/linalg/group_work.h"

namespace trajopt::linalg {

struct GroupBorder {
  int border = 0;
  long rows = 0;                           // of K
  long reached = 0;                        // first and last rows of E that may not be zero; or all
  long ld = 0;                             // of schur and unscaled
  const double* e = nullptr;               // (batch, rows, border)
  const double* f = nullptr;               // (batch, border, border), lower triangle
  const signed char* signs = nullptr;      // (batch, border)
  const double* regularization = nullptr;  // one number
  double* z = nullptr;                     // K^-1 E, (batch, rows, border)
  double* schur = nullptr;                 // S, then W: (batch, border, ld)
  double* unscaled = nullptr;              // scratch, as schur
  double* inverse = nullptr;               // (batch, border)
  GroupFailure* failures = nullptr;  // (batch,); block is 0 where a pivot of S failed, else -1

  // What K's failed_stage says of such an item.
  static constexpr int kFailed = GroupSystem::kNever - 1;

  TRAJOPT_HD long block_length() const { return ld * border; }
  TRAJOPT_HD const double* e_of(int item) const { return e + item * rows * border; }
  TRAJOPT_HD const double* f_of(int item) const {
    return f + static_cast<long>(item) * border * border;
  }
  TRAJOPT_HD double* z_of(int item) const { return z + item * rows * border; }
  TRAJOPT_HD double* schur_of(int item) const { return schur + item * block_length(); }
  TRAJOPT_HD double* inverse_of(int item) const {
    return inverse + static_cast<long>(item) * border;
  }
  // The rows of E that may not be zero, in one or two parts of `reached`: where each begins, the
  // last one first.
  TRAJOPT_HD int parts() const { return reached < rows ? 2 : 1; }
  TRAJOPT_HD long part(int index) const { return index + 1 < parts() ? rows - reached : 0; }
  // Vectors are (batch, rows + border, m): the border's unknowns stand behind K's.
  TRAJOPT_HD long stride(int m) const { return (rows + border) * m; }
};

}  // namespace trajopt::linalg

namespace trajopt::linalg::inline TRAJOPT_ISA::group {

// z = E, of which K^-1 E is made in place.
struct BorderCopyWork {
  static constexpr const char* kName = "border copy";
  static constexpr int kMaxRanks = 256;
  GroupSystem s;
  GroupBorder b;

  TRAJOPT_HD long jobs() const { return static_cast<long>(s.batch) * s.blocks; }
  TRAJOPT_HD int ranks() const { return kMaxRanks; }
  std::size_t bytes() const { return 0; }

  template <class Group>
  TRAJOPT_HD void operator()(const Group& group, long job, void*) const {
    const int item = s.item_at(static_cast<int>(job / s.blocks));
    if (item < 0) return;
    const long begin = job % s.blocks * s.size * b.border;
    const double* from = b.e_of(item) + begin;
    double* to = b.z_of(item) + begin;
    for_each(group, s.size * b.border, [&](int i) { to[i] = from[i]; });
  }
};

// S, its lower triangle.
struct BorderUpdateWork {
  static constexpr const char* kName = "border update";
  static constexpr int kMaxRanks = 256;
  GroupSystem s;
  GroupBorder b;

  TRAJOPT_HD int tiles() const { return update_tiles(b.border); }
  TRAJOPT_HD long jobs() const { return static_cast<long>(s.batch) * tiles() * tiles(); }
  TRAJOPT_HD int ranks() const { return warps(update_ranks(b.border)); }
  std::size_t bytes() const { return update_bytes(b.border); }

  template <class Group>
  TRAJOPT_HD void operator()(const Group& group, long job, void* space) const {
    const int column = static_cast<int>(job % tiles());
    job /= tiles();
    const int row = static_cast<int>(job % tiles());
    const int item = s.item_at(static_cast<int>(job / tiles()));
    if (item < 0 || column > row || s.failed_stage[item] != GroupSystem::kNever) return;
    Update u;
    u.size = b.border;
    u.depth = b.reached;
    u.ld = b.border;
    u.source = b.f_of(item);
    u.source_ld = b.border;
    u.target = b.schur_of(item);
    u.target_ld = b.ld;
    u.lower = true;
    u.terms = b.parts();
    TRAJOPT_UNROLL
    for (int t = 0; t < 2; ++t) {
      if (t == u.terms) break;
      const long begin = b.part(t) * b.border;
      u.term[t] = {b.e_of(item) + begin, b.z_of(item) + begin};
    }
    update_tile(group, u, row, column, space);
  }
};

struct BorderEliminateWork {
  static constexpr const char* kName = "border eliminate";
  static constexpr int kMaxRanks = 288;
  GroupSystem s;
  GroupBorder b;

  TRAJOPT_HD long jobs() const { return s.batch; }
  TRAJOPT_HD int ranks() const { return warps(b.border < kMaxRanks ? b.border : kMaxRanks); }
  std::size_t bytes() const { return EliminationSpace::bytes(b.border); }

  template <class Group>
  TRAJOPT_HD void operator()(const Group& group, long job, void* memory) const {
    const int item = s.item_at(static_cast<int>(job));
    if (item < 0 || s.failed_stage[item] != GroupSystem::kNever) return;
    Elimination e;
    e.size = b.border;
    e.ld = e.diagonal_ld = b.ld;
    e.diagonal = e.w = b.schur_of(item);
    e.original = b.f_of(item);
    e.signs = b.signs + static_cast<long>(item) * b.border;
    e.regularization = *b.regularization;
    e.u = b.unscaled + item * b.block_length();
    e.inverse = b.inverse_of(item);
    const EliminationSpace space(memory, b.border);
    if (eliminate(group, e, space) < 0) return;
    group.phase([&](int rank) {
      if (rank != 0) return;
      b.failures[item] = {0, space.failed->row, space.failed->value};
      s.failed_stage[item] = GroupBorder::kFailed;
    });
  }
};

// y = S^-1 (y - Et z) for the vectors v, whose first rows are z = K^-1 of their right-hand side; a
// job is a chunk of columns.
struct BorderSolveWork {
  static constexpr const char* kName = "border solve";
  static constexpr int kMaxRanks = 256;
  static constexpr int kDepth = 16;  // rows of E and z in shared memory
  GroupSystem s;
  GroupBorder b;
  GroupVectors v;

  TRAJOPT_HD long jobs() const { return vector_jobs(1, s, v.m); }
  TRAJOPT_HD int ranks() const { return vector_ranks(b.border, v.m); }
  std::size_t bytes() const {
    const std::size_t staged = kDepth * (b.border + kGroupColumns);
    return sizeof(double) * (b.border * kGroupColumns + kPanel * kPanel + staged);
  }

  template <class Group>
  TRAJOPT_HD void operator()(const Group& group, long number, void* memory) const {
    const VectorJob job(number, 1, s, v);
    if (job.skipped) return;
    const int n = b.border, m = v.m, columns = job.columns;
    const double* z = job.part(s, v.x, 0, m);
    double* y = job.part(s, v.x, s.blocks, m);
    const double *all = b.e_of(job.item), *w = b.schur_of(job.item);
    const double* inverse = b.inverse_of(job.item);
    double* x = static_cast<double*>(memory);
    double* corner = x + static_cast<long>(n) * kGroupColumns;
    double* e = corner + kPanel * kPanel;
    double* of_z = e + static_cast<long>(kDepth) * n;
    copy_columns(group, n, y, m, x, columns, columns);
    for (int p = 0; p < b.parts(); ++p) {
      for (long left = b.reached; left > 0; left -= kDepth) {
        const int depth = left < kDepth ? static_cast<int>(left) : kDepth;
        const long first = b.part(p) + left - depth;
        group.phase([&](int rank) {
          for (int t = rank; t < depth * n; t += group.size()) e[t] = all[first * n + t];
          for (int t = rank; t < depth * columns; t += group.size()) {
            of_z[t] = z[(first + t / columns) * m + t % columns];
          }
        });
        subtract_transposed(group, depth, n, e, n, of_z, x, columns, columns, columns);
      }
    }
    substitute_transposed(group, n, w, b.ld, x, columns, columns, corner);
    for_each(group, n * columns, [&](int t) { x[t] *= inverse[t / columns]; });
    substitute(group, n, w, b.ld, x, columns, columns, corner);
    copy_columns(group, n, x, columns, y, m, columns);
  }
};

// z -= Z y; a job is a block of rows and a chunk of columns.
struct BorderSpreadWork {
  static constexpr const char* kName = "border spread";
  static constexpr int kMaxRanks = 256;
  GroupSystem s;
  GroupBorder b;
  GroupVectors v;

  TRAJOPT_HD long jobs() const { return vector_jobs(s.blocks, s, v.m); }
  TRAJOPT_HD int ranks() const { return vector_ranks(s.size, v.m); }
  std::size_t bytes() const { return vector_bytes(s.size); }

  template <class Group>
  TRAJOPT_HD void operator()(const Group& group, long number, void* space) const {
    const VectorJob job(number, s.blocks, s, v);
    if (job.skipped) return;
    const double* y = job.part(s, v.x, s.blocks, v.m);
    double* z = job.part(s, v.x, job.entry, v.m);
    const double* of_z = b.z_of(job.item) + static_cast<long>(job.entry) * s.size * b.border;
    subtract(group, s.size, b.border, of_z, b.border, y, z, job.columns, v.m, v.m,
             static_cast<double*>(space));
  }
};

}  // namespace trajopt::linalg::inline TRAJOPT_ISA::group
