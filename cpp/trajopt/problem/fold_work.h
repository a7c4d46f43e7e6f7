// The launches that fold the items of frames and nodes into the numbers that the host decides on.
#pragma once

#include "trajopt/base/reduction.h"
#include "trajopt/problem/frames_system.h"

namespace trajopt::inline TRAJOPT_ISA {

// What a point is judged by: the sum of each term, and the largest constraint.
struct PointItems {
  const double *cost, *local_cost, *callback_cost, *constraint;
  int nterm, nlocal, ncallback, m;
  long frames;

  TRAJOPT_HD PointItems(const FramesSystem& s, bool tried)
      : cost(s.cost),
        local_cost(s.local_cost),
        callback_cost(s.callback_cost),
        constraint(s.point(tried).constraint),
        nterm(s.in.nterm),
        nlocal(s.nlocal),
        ncallback(s.ncallback),
        m(s.dual()),
        frames(s.frames()) {}
  TRAJOPT_HD double operator()(int fold, long f) const {
    if (fold < nterm) return cost[f * nterm + fold];
    fold -= nterm;
    if (fold < nlocal) return local_cost[fold * frames + f];
    fold -= nlocal;
    if (fold < ncallback) return callback_cost[fold * frames + f];
    double most = 0.0;
    for (int r = 0; r < m; ++r) most = Largest{}(most, magnitude(constraint[f * m + r]));
    return most;
  }
};

struct StepItems {
  const double* items;
  long nodes;
  TRAJOPT_HD StepItems(const FramesSystem& s, bool) : items(s.items), nodes(s.frames()) {}
  TRAJOPT_HD double operator()(int fold, long i) const { return items[fold * nodes + i]; }
};

// Folds of several sequences of a problem's items, as two launches: all chunks, then what is left
// of each sequence. Of the last sequence the largest value is wanted, of the others the sum.
template <class Items>
struct FoldChunksWork {
  static constexpr const char* kName = "fold chunks";
  static constexpr int kMaxRanks = kTreeWidth;
  FramesBatch b;
  bool tried;
  int folds;
  double* partial;  // places x folds x chunks

  TRAJOPT_HD long jobs() const { return b.places * folds * tree_chunks(b.frames); }
  TRAJOPT_HD int ranks() const { return kMaxRanks; }
  std::size_t bytes() const { return kTreeWidth * sizeof(double); }

  template <class Group>
  TRAJOPT_HD void operator()(const Group& group, long job, void* space) const {
    double* slots = static_cast<double*>(space);
    const long chunks = tree_chunks(b.frames), begin = job % chunks * kTreeWidth;
    const int fold = static_cast<int>(job / chunks % folds);
    const FramesSystem* s = b.system(job / chunks / folds);
    if (s == nullptr) return;
    const Items items(*s, tried);
    const auto get = [&](long i) { return items(fold, i); };
    if (fold + 1 < folds) {
      fold_chunk<Sum>(group, begin, b.frames, get, slots);
    } else {
      fold_chunk<Largest>(group, begin, b.frames, get, slots);
    }
    for_each(group, 1, [&](int) { partial[job] = slots[0]; });
  }
};

struct FoldRestWork {
  static constexpr const char* kName = "fold rest";
  static constexpr int kMaxRanks = kTreeWidth;
  FramesBatch b;
  int folds;
  double* partial;  // places x folds x chunks; overwritten
  double* result;   // places x folds

  TRAJOPT_HD long jobs() const { return b.places * folds; }
  TRAJOPT_HD int ranks() const { return kMaxRanks; }
  std::size_t bytes() const { return kTreeWidth * sizeof(double); }

  template <class Group>
  TRAJOPT_HD void operator()(const Group& group, long job, void* space) const {
    if (b.system(job / folds) == nullptr) return;
    double* slots = static_cast<double*>(space);
    const long chunks = tree_chunks(b.frames);
    double* values = partial + job * chunks;
    if (chunks > 1) {
      if (job % folds + 1 < folds) {
        fold_tree<Sum>(group, values, chunks, slots);
      } else {
        fold_tree<Largest>(group, values, chunks, slots);
      }
    }
    for_each(group, 1, [&](int) { result[job] = values[0]; });
  }
};

}  // namespace trajopt::inline TRAJOPT_ISA
