// The launches that fold the items of frames and nodes into the numbers that the host decides on.
#pragma once

#include "trajopt/base/reduction.h"
#include "trajopt/problem/frames_system.h"

namespace trajopt::inline TRAJOPT_ISA {

// What a point is judged by: the sum of each term, then the largest constraint of a frame and, of a
// spline, the largest of a control point. Nodes are no more than frames: what they lack is zero.
struct PointItems {
  const double *cost, *local_cost, *callback_cost, *frame_constraint, *constraint;
  int nterm, nlocal, ncallback, m, dual;
  long frames, nodes;

  TRAJOPT_HD PointItems(const FramesSystem& s, bool tried)
      : cost(s.cost),
        local_cost(s.local_cost),
        callback_cost(s.callback_cost),
        frame_constraint(s.point(tried).frame_constraint),
        constraint(s.point(tried).constraint),
        nterm(s.in.nterm),
        nlocal(s.nlocal),
        ncallback(s.ncallback),
        m(s.constraints()),
        dual(s.dual()),
        frames(s.frames()),
        nodes(s.nodes()) {}
  TRAJOPT_HD double operator()(int fold, long f) const {
    if (fold < nterm) return cost[f * nterm + fold];
    fold -= nterm;
    if (fold < nlocal) return local_cost[fold * frames + f];
    fold -= nlocal;
    if (fold < ncallback) return callback_cost[fold * frames + f];
    if (fold == ncallback) return most(frame_constraint + f * m, m);
    return f < nodes ? most(constraint + f * dual, dual) : 0.0;
  }
  TRAJOPT_HD static double most(const double* values, int count) {
    double largest = 0.0;
    for (int r = 0; r < count; ++r) largest = Largest{}(largest, magnitude(values[r]));
    return largest;
  }
};

struct StepItems {
  const double* items;
  long nodes;
  TRAJOPT_HD StepItems(const FramesSystem& s, bool) : items(s.items), nodes(s.nodes()) {}
  TRAJOPT_HD double operator()(int fold, long i) const { return items[fold * nodes + i]; }
};

// What is folded: `count` items of `folds` sequences a problem. Of the first `sums` the sum is
// wanted, of the others the largest value.
struct Folds {
  long count;
  int folds, sums;
  TRAJOPT_HD long chunks() const { return tree_chunks(count); }
};

// Folds of a problem's items, as two launches: all chunks, then what is left of each sequence.
template <class Items>
struct FoldChunksWork {
  static constexpr const char* kName = "fold chunks";
  static constexpr int kMaxRanks = kTreeWidth;
  FramesBatch b;
  bool tried;
  Folds f;
  double* partial;  // places x folds x chunks

  TRAJOPT_HD long jobs() const { return b.places * f.folds * f.chunks(); }
  TRAJOPT_HD int ranks() const { return kMaxRanks; }
  std::size_t bytes() const { return kTreeWidth * sizeof(double); }

  template <class Group>
  TRAJOPT_HD void operator()(const Group& group, long job, void* space) const {
    double* slots = static_cast<double*>(space);
    const long chunks = f.chunks(), begin = job % chunks * kTreeWidth;
    const int fold = static_cast<int>(job / chunks % f.folds);
    const FramesSystem* s = b.system(job / chunks / f.folds);
    if (s == nullptr) return;
    const Items items(*s, tried);
    const auto get = [&](long i) { return items(fold, i); };
    if (fold < f.sums) {
      fold_chunk<Sum>(group, begin, f.count, get, slots);
    } else {
      fold_chunk<Largest>(group, begin, f.count, get, slots);
    }
    for_each(group, 1, [&](int) { partial[job] = slots[0]; });
  }
};

struct FoldRestWork {
  static constexpr const char* kName = "fold rest";
  static constexpr int kMaxRanks = kTreeWidth;
  FramesBatch b;
  Folds f;
  double* partial;  // places x folds x chunks; overwritten
  double* result;   // places x folds

  TRAJOPT_HD long jobs() const { return b.places * f.folds; }
  TRAJOPT_HD int ranks() const { return kMaxRanks; }
  std::size_t bytes() const { return kTreeWidth * sizeof(double); }

  template <class Group>
  TRAJOPT_HD void operator()(const Group& group, long job, void* space) const {
    if (b.system(job / f.folds) == nullptr) return;
    double* slots = static_cast<double*>(space);
    const long chunks = f.chunks();
    double* values = partial + job * chunks;
    if (chunks > 1) {
      if (job % f.folds < f.sums) {
        fold_tree<Sum>(group, values, chunks, slots);
      } else {
        fold_tree<Largest>(group, values, chunks, slots);
      }
    }
    for_each(group, 1, [&](int) { result[job] = values[0]; });
  }
};

}  // namespace trajopt::inline TRAJOPT_ISA
