// The threads that work on one block together, as a template parameter of the algorithm.
//
// An algorithm for a group is a sequence of phases. In a phase every rank runs the same body for
// its own rank, ranks do not read what others write, and a barrier ends it:
//
//   group.phase([&](int rank) { ... });
//
// Group is Serial (one rank, no barrier), a CUDA thread block (cuda/trajopt/cuda/base/
// thread_block.h), or Emulated: many ranks on one processor, one after the other in a chosen order.
// An algorithm that gives the same bits for all of them has neither a race nor a dependence on the
// number of threads. What a rank keeps from phase to phase lives in a Group::Local<T>. What several
// groups write is a minimum or a maximum, which no order changes: lower() and raise().
#pragma once

#include <vector>

#include "trajopt/base/hd.h"

namespace trajopt::inline TRAJOPT_ISA {

// The larger one, or NaN if there is one.
TRAJOPT_HD inline double largest(double a, double b) {
  if (a != a) return a;
  return b != b || b > a ? b : a;
}

// TRAJOPT_HD so that bodies marked likewise may use it; the device has a group of its own.
class Serial {
 public:
  template <class T>
  class Local {
   public:
    TRAJOPT_HD explicit Local(const Serial&) {}
    TRAJOPT_HD T& operator[](int) { return value_; }

   private:
    T value_;
  };

  TRAJOPT_HD int size() const { return 1; }
  template <class Body>
  TRAJOPT_HD void phase(const Body& body) const {
    body(0);
  }
  TRAJOPT_HD void lower(int* where, int value) const {
    if (value < *where) *where = value;
  }
  // For magnitudes: values that are not negative, or NaN, which wins.
  TRAJOPT_HD void raise(double* where, double value) const { *where = largest(*where, value); }
};

enum class RankOrder { forward, reverse };

class Emulated {
 public:
  template <class T>
  class Local {
   public:
    explicit Local(const Emulated& group) : values_(group.size()) {}
    T& operator[](int rank) { return values_[rank]; }

   private:
    std::vector<T> values_;
  };

  Emulated(int size, RankOrder order) : size_(size), order_(order) {}

  int size() const { return size_; }
  template <class Body>
  void phase(const Body& body) const {
    for (int i = 0; i < size_; ++i) body(order_ == RankOrder::forward ? i : size_ - 1 - i);
  }
  void lower(int* where, int value) const { Serial{}.lower(where, value); }
  void raise(double* where, double value) const { Serial{}.raise(where, value); }

 private:
  int size_;
  RankOrder order_;
};

// One phase: body(index) for index in [0, count), dealt out to the ranks in turn.
template <class Group, class Body>
TRAJOPT_HD inline void for_each(const Group& group, int count, const Body& body) {
  group.phase([&](int rank) {
    for (int i = rank; i < count; i += group.size()) body(i);
  });
}

}  // namespace trajopt::inline TRAJOPT_ISA
