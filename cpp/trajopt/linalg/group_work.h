// The launches of a factorization and a solution, one type each. A launch is a number of jobs that
// do not depend on each other; a job is done by one group:
//
//   work.jobs()    how many
//   work.ranks()   threads that find work in a job, at most kMaxRanks
//   work.bytes()   memory the ranks of a job share
//   work(group, job, space)
#pragma once

#include "trajopt/linalg/group_eliminate.h"
#include "trajopt/linalg/group_system.h"
#include "trajopt/linalg/group_update.h"
#include "trajopt/linalg/group_vector.h"

namespace trajopt::linalg::inline TRAJOPT_ISA::group {

// Whole warps.
TRAJOPT_HD constexpr int warps(int ranks) { return (ranks + kWarp - 1) / kWarp * kWarp; }

// Has an earlier stage failed? A launch of the same stage may set failed_stage[item] to `stage`
// meanwhile, which does not change the answer: it is the same to every rank.
template <class T>
TRAJOPT_HD inline bool given_up(const BasicGroupSystem<T>& s, int item, int stage) {
  return s.failed_stage[item] < stage;
}

template <class T>
struct EliminateWork {
  static constexpr const char* kName = "eliminate";
  static constexpr int kMaxRanks = 288;
  BasicGroupSystem<T> s;
  const PlannedElimination* entries;
  int count, stage;

  TRAJOPT_HD long jobs() const { return static_cast<long>(count) * s.batch; }
  // A warp for the corner, and a rank for every second column of two couplings; small blocks keep
  // to one warp.
  TRAJOPT_HD int ranks() const {
    if (s.size <= kWarp / 2) return kWarp;
    return kWarp + warps(s.size < kMaxRanks - kWarp ? s.size : kMaxRanks - kWarp);
  }
  std::size_t bytes() const { return BasicEliminationSpace<T>::bytes(s.size); }

  template <class Group>
  TRAJOPT_HD void operator()(const Group& group, long job, void* memory) const {
    const int item = s.item_at(static_cast<int>(job / count));
    if (item < 0) return;
    const PlannedElimination& p = entries[job % count];
    if (given_up(s, item, stage) || s.failure(item, p.run).block >= 0) return;
    const int n = s.size;
    BasicElimination<T> e;
    e.size = n;
    e.ld = s.ld;
    e.w = s.w_of(item, p.block);
    e.u = s.scratch_of(item, p.run, 0);
    e.original = s.diagonal_of(item, p.block);
    e.diagonal = p.diagonal_original ? BlockSource<T>(e.original) : BlockSource<T>(e.w);
    e.diagonal_ld = p.diagonal_original ? n : s.ld;
    e.signs = s.signs_of(item, p.block);
    e.regularization = *s.regularization;
    e.inverse = s.inverse_of(item, p.block);
    if (p.left >= 0) {
      T* v = s.coupling(item, p.left_slot);
      e.left = {v, s.ld, 1, v, s.scratch_of(item, p.run, 1)};
      if (p.left_original) {
        e.left.source = s.lower_of(item, p.block - 1);
        e.left.row = n;
      }
    }
    if (p.right >= 0) {
      T* v = s.coupling(item, p.right_slot);
      e.right = {v, s.ld, 1, v, s.scratch_of(item, p.run, 2)};
      if (p.right_original) {  // stored by the neighbour's rows
        e.right.source = s.lower_of(item, p.block);
        e.right.row = 1;
        e.right.column = n;
      }
    }
    const BasicEliminationSpace<T> space(memory, n);
    if (eliminate(group, e, space) < 0) return;
    group.phase([&](int rank) {
      if (rank != 0) return;
      s.failure(item, p.run) = {p.block, space.failed->row, space.failed->value};
      group.lower(&s.failed_stage[item], stage);
      group.lower(s.failed_item, item);
    });
  }
};

// The neighbours' diagonal blocks and the fill.
template <class T>
struct UpdateWork {
  static constexpr const char* kName = "update";
  static constexpr int kMaxRanks = 256;
  BasicGroupSystem<T> s;
  const PlannedUpdate* entries;
  int count, stage;

  TRAJOPT_HD int tiles() const { return update_tiles(s.size); }
  TRAJOPT_HD long jobs() const { return static_cast<long>(count) * s.batch * tiles() * tiles(); }
  TRAJOPT_HD int ranks() const { return warps(update_ranks(s.size)); }
  std::size_t bytes() const { return update_bytes<T>(s.size); }

  template <class Group>
  TRAJOPT_HD void operator()(const Group& group, long job, void* space) const {
    const int column = static_cast<int>(job % tiles());
    job /= tiles();
    const int row = static_cast<int>(job % tiles());
    job /= tiles();
    const int item = s.item_at(static_cast<int>(job / count));
    if (item < 0) return;
    const PlannedUpdate& p = entries[job % count];
    if (given_up(s, item, stage) || (!p.fill && column > row)) return;
    BasicUpdate<T> u;
    u.size = s.size;
    u.depth = s.size;
    u.ld = u.target_ld = s.ld;
    u.lower = !p.fill;
    u.target = p.fill ? s.coupling(item, p.target) : s.w_of(item, p.target);
    if (!p.fill) {
      u.source = p.from_original ? BlockSource<T>(s.diagonal_of(item, p.target))
                                 : BlockSource<T>(u.target);
      u.source_ld = p.from_original ? s.size : s.ld;
    }
    u.terms = p.terms;
    TRAJOPT_UNROLL
    for (int t = 0; t < 2; ++t) {
      if (t == p.terms) break;
      const PlannedTerm& term = p.term[t];
      u.term[t] = {s.coupling(item, term.slot), s.scratch_of(item, term.run, term.left ? 1 : 2)};
    }
    update_tile(group, u, row, column, space);
  }
};

// A job of the solution: a block of an item, and up to kGroupColumns of its columns.
struct VectorJob {
  int entry, item, chunk, columns;
  long stride;
  bool skipped;
  template <class T>
  TRAJOPT_HD VectorJob(long job, int count, const GroupMatrix& s, const BasicGroupVectors<T>& v) {
    const int chunks = column_chunks(v.m);
    chunk = static_cast<int>(job % chunks);
    job /= chunks;
    item = s.item_at(static_cast<int>(job / count));
    entry = static_cast<int>(job % count);
    const int left = v.m - chunk * kGroupColumns;
    columns = left < kGroupColumns ? left : kGroupColumns;
    stride = v.stride > 0 ? v.stride : static_cast<long>(s.blocks) * s.size * v.m;
    skipped = item < 0;
    if (!skipped && v.active) skipped = !v.active[static_cast<long>(item) * chunks + chunk];
  }
  // The block's part of (batch, blocks * size, m).
  template <class T>
  TRAJOPT_HD T* part(const GroupMatrix& s, T* x, int block, int m) const {
    return x + item * stride + static_cast<long>(block) * s.size * m + chunk * kGroupColumns;
  }
};

TRAJOPT_HD inline long vector_jobs(int count, const GroupMatrix& s, int m) {
  return static_cast<long>(count) * s.batch * column_chunks(m);
}
TRAJOPT_HD inline int vector_ranks(int size, int m) {
  const int parts = m < kGroupColumns ? (m + kSide - 1) / kSide : kGroupColumns / kSide;
  return warps(size * parts < 256 ? size * parts : 256);
}

// Shared memory of a solving job: the columns, the space of the operations, and W if it fits.
template <class T>
struct VectorSpace {
  T *x, *operations, *w;
  TRAJOPT_HD VectorSpace(void* memory, int size)
      : x(static_cast<T*>(memory)),
        operations(x + static_cast<long>(size) * kGroupColumns),
        w(operations + vector_bytes<T>(size) / sizeof(T)) {}
  static constexpr std::size_t bytes(int size, bool with_w) {
    const std::size_t w = with_w ? sizeof(T) * size * w_stride(size) : 0;
    return sizeof(T) * size * kGroupColumns + vector_bytes<T>(size) + w;
  }
  // Odd: the elements of a column lie in different banks.
  TRAJOPT_HD static constexpr long w_stride(int size) { return size | 1; }
};

template <class Group, class T>
TRAJOPT_HD inline void copy_columns(const Group& group, int size, const T* from, long from_ld,
                                    T* to, long to_ld, int columns) {
  for_each(group, size * columns, [&](int at) {
    const int i = at / columns, j = at - i * columns;
    to[i * to_ld + j] = from[i * from_ld + j];
  });
}

// W of a block: copied to shared memory if there is room, so that a solution waits for the memory
// once and not once a panel.
template <class T>
struct WView {
  const T* data;
  long ld;
};
template <class Group, class T>
TRAJOPT_HD inline WView<T> stage_w(const Group& group, const BasicGroupSystem<T>& s, int item,
                                   int block, const VectorSpace<T>& space) {
  const T* w = s.w_of(item, block);
  if (!s.stage_w) return {w, s.ld};
  const long stride = VectorSpace<T>::w_stride(s.size);
  for_each(group, s.size * s.size, [&](int at) {
    const int i = at / s.size, j = at - i * s.size;
    if (j < i) space.w[i * stride + j] = w[i * s.ld + j];
  });
  return {space.w, stride};
}

// x = W^-T x of the blocks a level eliminates.
template <class T>
struct ForwardWork {
  static constexpr const char* kName = "forward";
  static constexpr int kMaxRanks = 256;
  BasicGroupSystem<T> s;
  BasicGroupVectors<T> v;
  const PlannedElimination* entries;
  int count;

  TRAJOPT_HD long jobs() const { return vector_jobs(count, s, v.m); }
  TRAJOPT_HD int ranks() const { return vector_ranks(s.size, v.m); }
  std::size_t bytes() const { return VectorSpace<T>::bytes(s.size, s.stage_w); }

  template <class Group>
  TRAJOPT_HD void operator()(const Group& group, long number, void* memory) const {
    const VectorJob job(number, count, s, v);
    if (job.skipped) return;
    const int block = entries[job.entry].block;
    const VectorSpace<T> space(memory, s.size);
    T* x = job.part(s, v.x, block, v.m);
    const WView<T> w = stage_w(group, s, job.item, block, space);
    copy_columns(group, s.size, x, v.m, space.x, job.columns, job.columns);
    substitute_transposed(group, s.size, w.data, w.ld, space.x, job.columns, job.columns,
                          space.operations);
    copy_columns(group, s.size, space.x, job.columns, x, v.m, job.columns);
  }
};

// y -= Vt x from the eliminated blocks to their neighbours.
template <class T>
struct GatherWork {
  static constexpr const char* kName = "gather";
  static constexpr int kMaxRanks = 256;
  BasicGroupSystem<T> s;
  BasicGroupVectors<T> v;
  const PlannedUpdate* entries;  // of diagonal blocks
  int count;

  TRAJOPT_HD long jobs() const { return vector_jobs(count, s, v.m); }
  TRAJOPT_HD int ranks() const { return vector_ranks(s.size, v.m); }
  std::size_t bytes() const { return 0; }

  template <class Group>
  TRAJOPT_HD void operator()(const Group& group, long number, void*) const {
    const VectorJob job(number, count, s, v);
    if (job.skipped) return;
    const PlannedUpdate& p = entries[job.entry];
    T* y = job.part(s, v.x, p.target, v.m);
    for (int t = 0; t < p.terms; ++t) {
      subtract_transposed(group, s.size, s.size, s.coupling(job.item, p.term[t].slot), s.ld,
                          job.part(s, v.x, p.term[t].from, v.m), y, job.columns, v.m, v.m);
    }
  }
};

// x = W^-1 (D^-1 x - V x of the neighbours).
template <class T>
struct BackwardWork {
  static constexpr const char* kName = "backward";
  static constexpr int kMaxRanks = 256;
  BasicGroupSystem<T> s;
  BasicGroupVectors<T> v;
  const PlannedElimination* entries;
  int count;

  TRAJOPT_HD long jobs() const { return vector_jobs(count, s, v.m); }
  TRAJOPT_HD int ranks() const { return vector_ranks(s.size, v.m); }
  std::size_t bytes() const { return VectorSpace<T>::bytes(s.size, s.stage_w); }

  template <class Group>
  TRAJOPT_HD void operator()(const Group& group, long number, void* memory) const {
    const VectorJob job(number, count, s, v);
    if (job.skipped) return;
    const PlannedElimination& p = entries[job.entry];
    const VectorSpace<T> space(memory, s.size);
    const int columns = job.columns;
    T* x = job.part(s, v.x, p.block, v.m);
    const T* inverse = s.inverse_of(job.item, p.block);
    const WView<T> w = stage_w(group, s, job.item, p.block, space);
    for_each(group, s.size * columns, [&](int at) {
      const int i = at / columns, j = at - i * columns;
      space.x[at] = x[static_cast<long>(i) * v.m + j] * inverse[i];
    });
    const auto subtract_from = [&](int neighbour, int slot) {
      if (neighbour < 0) return;
      subtract(group, s.size, s.size, s.coupling(job.item, slot), s.ld,
               job.part(s, v.x, neighbour, v.m), space.x, columns, v.m, columns, space.operations);
    };
    subtract_from(p.left, p.left_slot);
    subtract_from(p.right, p.right_slot);
    substitute(group, s.size, w.data, w.ld, space.x, columns, columns, space.operations);
    copy_columns(group, s.size, space.x, columns, x, v.m, columns);
  }
};

}  // namespace trajopt::linalg::inline TRAJOPT_ISA::group
