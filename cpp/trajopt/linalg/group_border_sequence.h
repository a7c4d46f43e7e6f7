// The order of the launches for a matrix with a border, around those of group_sequence.h.
#pragma once

#include "trajopt/linalg/group_border_refine.h"
#include "trajopt/linalg/group_sequence.h"

namespace trajopt::linalg {

// x: (batch, rows + border, m), in place. Where `active` is given: as in GroupVectors.
template <class Executor>
void sequence_border_solve(const Executor& run, const GroupPlan& plan, const PlanEntries& at,
                           const GroupSystem& s, const GroupBorder& b, double* x, int m,
                           const int* active = nullptr) {
  const GroupVectors v{x, m, active, b.stride(m)};
  sequence_solve(run, plan, at, s, v);
  run(group::BorderSolveWork{s, b, v});
  run(group::BorderSpreadWork{s, b, v});
}

// After K's factorization: the border's. Its failures have to be reset before.
template <class Executor>
void sequence_border_factor(const Executor& run, const GroupPlan& plan, const PlanEntries& at,
                            const GroupSystem& s, const GroupBorder& b) {
  run(group::BorderCopyWork{s, b});
  sequence_solve(run, plan, at, s, {b.z, b.border, nullptr});
  run(group::BorderUpdateWork{s, b});
  run(group::BorderEliminateWork{s, b});
}

// Improves x towards A x = rhs; K, E and F are read again.
template <class Executor>
void sequence_border_refine(const Executor& run, const GroupPlan& plan, const PlanEntries& at,
                            const GroupSystem& s, const GroupBorder& b, double* x, int m,
                            int max_steps, double tolerance, const BorderRefineArrays& a) {
  using Decide = group::DecideWork;
  const auto decide = [&](Decide::When when) {
    run(group::BorderDecideWork{{when, s, m, max_steps, tolerance, a.norm, a.states, a.active},
                                a.going});
  };
  const GroupVectors all{x, m, nullptr, b.stride(m)}, going_on{x, m, a.going, b.stride(m)};
  const GroupVectors none{nullptr, m, nullptr, b.stride(m)};
  run(group::BorderResidualWork{s, b, none, a.rhs, a.r, a.norm});
  decide(Decide::When::scale);
  run(group::BorderResidualWork{s, b, all, a.rhs, a.r, a.norm});
  decide(Decide::When::start);
  // At most max_steps corrections change anything, so that many finish the refinement.
  for (int k = 0; k < max_steps; ++k) {
    sequence_border_solve(run, plan, at, s, b, a.r, m, a.going);
    run(group::BorderCorrectWork{s, b, going_on, a, false});
    run(group::BorderResidualWork{s, b, going_on, a.rhs, a.r, a.norm});
    decide(Decide::When::step);
    run(group::BorderCorrectWork{s, b, all, a, true});
  }
}

}  // namespace trajopt::linalg
