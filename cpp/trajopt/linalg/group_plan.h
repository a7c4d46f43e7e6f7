// A schedule as a list of launches: what of each stage can be done at once, for an executor whose
// unit of work is "this operation for all these blocks".
//
// The runs of a stage advance in step. A level eliminates one block of every run, then updates the
// neighbours and forms the fill. Updates that a schedule defers behind the stage's barrier join the
// stage's last level; where they meet another update of the same block they follow it in the same
// chain. So every element sees the same operations in the same order as in Factorization.
#pragma once

#include <vector>

#include "trajopt/linalg/schedule.h"

namespace trajopt::linalg {

struct PlannedElimination {
  int block, left, right;     // as in Step
  int left_slot, right_slot;  // storage of the couplings, -1: none
  int run;                    // index of the run in its stage
  bool left_original, right_original, diagonal_original;
};

// A term -Vt U: V in coupling slot `slot`; U in the scratch of the run, of its left or its right
// coupling; both of the eliminated block `from`.
struct PlannedTerm {
  int slot, from, run;
  bool left;
};

// The lower triangle of a diagonal block, or a fill: the coupling in slot `target`.
struct PlannedUpdate {
  int target;
  bool fill;
  bool from_original;  // the first update of a block starts from the matrix's own
  int terms;
  PlannedTerm term[2];
};

struct PlannedLevel {
  int stage;
  int eliminations_begin, eliminations_end;
  int updates_begin, fills_begin, updates_end;  // diagonal blocks first
};

struct GroupPlan {
  Ordering ordering;
  int slots = 0;  // couplings a factorization stores
  int runs = 0;   // most runs in a stage
  std::vector<PlannedElimination> eliminations;
  std::vector<PlannedUpdate> updates;
  std::vector<PlannedLevel> levels;
};

GroupPlan make_group_plan(int blocks, const Schedule& schedule);

}  // namespace trajopt::linalg
