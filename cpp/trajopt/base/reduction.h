// Sums and maxima in an order that their length alone decides.
//
// The values are cut into chunks of 64, the last one filled up with zeros; a chunk is folded in
// half six times (slot i takes slot i + 32, then i + 16, ...); the sums of the chunks are values
// again, until one is left. Threads, SIMD lanes and GPU blocks share the work of a fold as they
// like: the tree, and so the rounding, stays the same.
#pragma once

#include <cstddef>

#include "trajopt/base/group.h"
#include "trajopt/base/hd.h"

namespace trajopt::inline TRAJOPT_ISA {

inline constexpr int kTreeWidth = 64;

TRAJOPT_HD constexpr long tree_chunks(long count) { return (count + kTreeWidth - 1) / kTreeWidth; }

struct Sum {
  TRAJOPT_HD double operator()(double a, double b) const { return a + b; }
};

// Of magnitudes: what is not finite counts as infinite, so that no norm hides it.
struct Largest {
  TRAJOPT_HD double operator()(double a, double b) const { return a > b ? a : b; }
};
TRAJOPT_HD inline double magnitude(double x) {
  const double a = x < 0 ? -x : x;
  return a < __builtin_huge_val() ? a : __builtin_huge_val();
}

// The value of one chunk: slots[0] afterwards. `get(i)` is value i of the sequence, whose items
// begin .. begin + kTreeWidth the chunk covers as far as `count` goes.
template <class Fold, class Group, class Get>
TRAJOPT_HD inline void fold_chunk(const Group& group, long begin, long count, const Get& get,
                                  double* slots) {
  const Fold fold;
  for_each(group, kTreeWidth, [&](int i) { slots[i] = begin + i < count ? get(begin + i) : 0.0; });
  for (int half = kTreeWidth / 2; half > 0; half /= 2) {
    for_each(group, half, [&](int i) { slots[i] = fold(slots[i], slots[i + half]); });
  }
}

// Folds values[0 .. count) into values[0]; overwrites the rest.
template <class Fold, class Group>
TRAJOPT_HD inline void fold_tree(const Group& group, double* values, long count, double* slots) {
  do {
    const long chunks = tree_chunks(count);
    for (long c = 0; c < chunks; ++c) {
      fold_chunk<Fold>(
          group, c * kTreeWidth, count, [&](long i) { return values[i]; }, slots);
      for_each(group, 1, [&](int) { values[c] = slots[0]; });
    }
    count = chunks;
  } while (count > 1);
}

// One processor's use: the sum or maximum of values[0 .. count), which are overwritten.
template <class Fold>
inline double folded(double* values, long count) {
  if (count == 0) return 0.0;
  double slots[kTreeWidth];
  fold_tree<Fold>(Serial{}, values, count, slots);
  return values[0];
}

}  // namespace trajopt::inline TRAJOPT_ISA
