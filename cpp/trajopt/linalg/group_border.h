// The launches that a border of dense unknowns adds, as BorderedFactorization: the Schur complement
// S = F - Et K^-1 E, its elimination, and the border's part of a solution.
//
// Et Z and Et z are one chain per element over all rows of K: the definition leaves a device only
// the border's own columns to divide, so their floor is the latency of a chain of n B operations.
#pragma once

#include "trajopt/linalg/group_work.h"

namespace trajopt::linalg {

struct GroupBorder {
  int border = 0;
  long rows = 0;                           // of K
  long ld = 0;                             // of schur and unscaled
  const double* e = nullptr;               // rows x border
  const double* f = nullptr;               // border x border, lower triangle
  const signed char* signs = nullptr;      // border
  const double* regularization = nullptr;  // one number
  const int* failed_item = nullptr;        // of K
  double* z = nullptr;                     // K^-1 E, rows x border
  double* schur = nullptr;                 // S, then W
  double* unscaled = nullptr;              // scratch
  double* inverse = nullptr;
  GroupFailure* failure = nullptr;  // one; block is 0 where a pivot of S failed, else -1
};

}  // namespace trajopt::linalg

namespace trajopt::linalg::inline TRAJOPT_ISA::group {

// S, its lower triangle.
struct BorderUpdateWork {
  static constexpr const char* kName = "border update";
  static constexpr int kMaxRanks = 256;
  GroupBorder b;

  TRAJOPT_HD int tiles() const { return update_tiles(b.border); }
  TRAJOPT_HD long jobs() const { return static_cast<long>(tiles()) * tiles(); }
  TRAJOPT_HD int ranks() const { return warps(update_ranks(b.border)); }
  std::size_t bytes() const { return update_bytes(b.border); }

  template <class Group>
  TRAJOPT_HD void operator()(const Group& group, long job, void* space) const {
    const int row = static_cast<int>(job / tiles()), column = static_cast<int>(job % tiles());
    if (column > row || *b.failed_item != GroupSystem::kNever) return;
    Update u;
    u.size = b.border;
    u.depth = b.rows;
    u.ld = b.border;
    u.source = b.f;
    u.source_ld = b.border;
    u.target = b.schur;
    u.target_ld = b.ld;
    u.lower = true;
    u.terms = 1;
    u.term[0] = {b.e, b.z};
    update_tile(group, u, row, column, space);
  }
};

struct BorderEliminateWork {
  static constexpr const char* kName = "border eliminate";
  static constexpr int kMaxRanks = 288;
  GroupBorder b;

  TRAJOPT_HD long jobs() const { return 1; }
  TRAJOPT_HD int ranks() const { return warps(b.border < kMaxRanks ? b.border : kMaxRanks); }
  std::size_t bytes() const { return EliminationSpace::bytes(b.border); }

  template <class Group>
  TRAJOPT_HD void operator()(const Group& group, long, void* memory) const {
    if (*b.failed_item != GroupSystem::kNever) return;
    Elimination e;
    e.size = b.border;
    e.ld = e.diagonal_ld = b.ld;
    e.diagonal = e.w = b.schur;
    e.original = b.f;
    e.signs = b.signs;
    e.regularization = *b.regularization;
    e.u = b.unscaled;
    e.inverse = b.inverse;
    const EliminationSpace space(memory, b.border);
    if (eliminate(group, e, space) < 0) return;
    group.phase([&](int rank) {
      if (rank == 0) *b.failure = {0, space.failed->row, space.failed->value};
    });
  }
};

// y = S^-1 (y - Et z), with z = K^-1 of its right-hand side, rows x m; a job is a chunk of columns.
struct BorderSolveWork {
  static constexpr const char* kName = "border solve";
  static constexpr int kMaxRanks = 256;
  static constexpr int kDepth = 16;  // rows of E and z in shared memory
  GroupBorder b;
  const double* z;
  double* y;
  int m;

  TRAJOPT_HD long jobs() const { return column_chunks(m); }
  TRAJOPT_HD int ranks() const { return vector_ranks(b.border, m); }
  std::size_t bytes() const {
    const std::size_t staged = kDepth * (b.border + kGroupColumns);
    return sizeof(double) * (b.border * kGroupColumns + kPanel * kPanel + staged);
  }

  template <class Group>
  TRAJOPT_HD void operator()(const Group& group, long job, void* memory) const {
    const int c = static_cast<int>(job) * kGroupColumns, n = b.border;
    const int columns = m - c < kGroupColumns ? m - c : kGroupColumns;
    double* x = static_cast<double*>(memory);
    double* corner = x + static_cast<long>(n) * kGroupColumns;
    double* e = corner + kPanel * kPanel;
    double* of_z = e + static_cast<long>(kDepth) * n;
    copy_columns(group, n, y + c, m, x, columns, columns);
    for (long last = b.rows; last > 0; last -= kDepth) {
      const int depth = last < kDepth ? static_cast<int>(last) : kDepth;
      const long first = last - depth;
      group.phase([&](int rank) {
        for (int t = rank; t < depth * n; t += group.size()) e[t] = b.e[first * n + t];
        for (int t = rank; t < depth * columns; t += group.size()) {
          of_z[t] = z[(first + t / columns) * m + c + t % columns];
        }
      });
      subtract_transposed(group, depth, n, e, n, of_z, x, columns, columns, columns);
    }
    substitute_transposed(group, n, b.schur, b.ld, x, columns, columns, corner);
    for_each(group, n * columns, [&](int t) { x[t] *= b.inverse[t / columns]; });
    substitute(group, n, b.schur, b.ld, x, columns, columns, corner);
    copy_columns(group, n, x, columns, y + c, m, columns);
  }
};

// z -= Z y; a job is a block of rows and a chunk of columns.
struct BorderSpreadWork {
  static constexpr const char* kName = "border spread";
  static constexpr int kMaxRanks = 256;
  GroupBorder b;
  int size;  // of a block
  const double* y;
  double* z;
  int m;

  TRAJOPT_HD long jobs() const { return b.rows / size * column_chunks(m); }
  TRAJOPT_HD int ranks() const { return vector_ranks(size, m); }
  std::size_t bytes() const { return vector_bytes(size); }

  template <class Group>
  TRAJOPT_HD void operator()(const Group& group, long job, void* space) const {
    const int c = static_cast<int>(job % column_chunks(m)) * kGroupColumns;
    const long row = job / column_chunks(m) * size;
    subtract(group, size, b.border, b.z + row * b.border, b.border, y + c, z + row * m + c,
             m - c < kGroupColumns ? m - c : kGroupColumns, m, m, static_cast<double*>(space));
  }
};

}  // namespace trajopt::linalg::inline TRAJOPT_ISA::group
