// What the launches of a factorization work on: the arrays, as plain pointers, and where in them a
// block lies. An executor allocates the arrays, in its own memory.
#pragma once

#include "trajopt/base/hd.h"
#include "trajopt/linalg/group_plan.h"

namespace trajopt::linalg {

// Right-hand sides that one launch solves together, and that refine() measures together, as
// Factorization::refine does.
inline constexpr int kGroupColumns = 8;
TRAJOPT_HD inline int column_chunks(int m) { return (m + kGroupColumns - 1) / kGroupColumns; }

// The first pivot that failed in a run.
struct GroupFailure {
  int block;  // -1: none
  int row;
  double value;
};

// The matrices, and which of them the launches are for.
struct GroupMatrix {
  int blocks = 0, size = 0, batch = 0;
  const double* diagonal = nullptr;  // (batch, blocks, size, size)
  const double* lower = nullptr;     // (batch, blocks - 1, size, size)
  // Where given: how many items these launches are for, and which. `batch` then is the number of
  // places in a launch, which may be larger.
  const int* listed = nullptr;

  // The item in a place of a launch; -1: none.
  TRAJOPT_HD int item_at(int place) const {
    if (listed == nullptr) return place;
    return place < listed[0] ? listed[1 + place] : -1;
  }
  TRAJOPT_HD const double* diagonal_of(int item, int block) const {
    return diagonal + (static_cast<long>(item) * blocks + block) * size * size;
  }
  TRAJOPT_HD const double* lower_of(int item, int block) const {
    return lower + (static_cast<long>(item) * (blocks - 1) + block) * size * size;
  }
};

// With factors in scalar type T.
template <class T>
struct BasicGroupSystem : GroupMatrix {
  int slots = 0, runs = 0;
  long ld = 0;                             // of the blocks in w, couplings and scratch
  bool stage_w = false;                    // solve with a copy of W in shared memory
  const signed char* signs = nullptr;      // (batch, blocks * size)
  const double* regularization = nullptr;  // one number
  T* w = nullptr;                          // (batch, blocks) blocks
  T* couplings = nullptr;                  // (batch, slots) blocks: V
  T* inverse = nullptr;                    // (batch, blocks * size): D^-1
  T* scratch = nullptr;  // (batch, runs, 3) blocks: D W, U of the left and right coupling
  GroupFailure* failures = nullptr;  // (batch, runs), of the stage in which an item failed
  int* failed_stage = nullptr;       // (batch,): kNever or the first stage with a failure
  int* failed_item = nullptr;        // kNever or the first item with a failure

  static constexpr int kNever = 0x7f7f7f7f;  // every byte the same: a device can set it as memory

  TRAJOPT_HD const GroupMatrix& matrix() const { return *this; }
  TRAJOPT_HD long block_length() const { return ld * size; }
  TRAJOPT_HD const signed char* signs_of(int item, int block) const {
    return signs + (static_cast<long>(item) * blocks + block) * size;
  }
  TRAJOPT_HD T* w_of(int item, int block) const {
    return w + (static_cast<long>(item) * blocks + block) * block_length();
  }
  TRAJOPT_HD T* coupling(int item, int slot) const {
    return couplings + (static_cast<long>(item) * slots + slot) * block_length();
  }
  TRAJOPT_HD T* inverse_of(int item, int block) const {
    return inverse + (static_cast<long>(item) * blocks + block) * size;
  }
  // which: 0 the block itself, 1 left, 2 right.
  TRAJOPT_HD T* scratch_of(int item, int run, int which) const {
    return scratch + ((static_cast<long>(item) * runs + run) * 3 + which) * block_length();
  }
  TRAJOPT_HD GroupFailure& failure(int item, int run) const {
    return failures[static_cast<long>(item) * runs + run];
  }
};

using GroupSystem = BasicGroupSystem<double>;

// Leading dimension of the blocks above: whole 32-byte sectors of memory.
template <class T = double>
long group_ld(int size) {
  constexpr long sector = 32 / static_cast<long>(sizeof(T));
  return (size + sector - 1) / sector * sector;
}

// x: right-hand sides and then solutions, (batch, blocks * size, m). Where `active` is given, the
// columns of item i from 8 c on are left alone unless active[i * column_chunks(m) + c].
template <class T>
struct BasicGroupVectors {
  T* x = nullptr;
  int m = 1;
  const int* active = nullptr;
  long stride = 0;  // from item to item, where something stands between; 0: nothing does
};

using GroupVectors = BasicGroupVectors<double>;

// Room in which right-hand sides are solved for with float32 factors (group_round.h).
struct GroupRounding {
  float* x = nullptr;       // (batch, blocks * size, m)
  double* peak = nullptr;   // (batch, m): largest magnitudes; zero on entry and on return
  double* scale = nullptr;  // (batch, m): the powers of two that columns were divided by
};

// State of the refinement of some columns of one item: refine_loop() turned inside out.
struct GroupRefinement {
  double residual;  // relative
  double scale;
  int steps;
  bool undo;  // the last correction has to be taken back
};

}  // namespace trajopt::linalg
