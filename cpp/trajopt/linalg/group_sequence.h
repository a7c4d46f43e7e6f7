// The order of the launches, for any executor. run(work) does all jobs of one launch before those
// of the next begin.
#pragma once

#include <type_traits>

#include "trajopt/linalg/group_refine.h"
#include "trajopt/linalg/group_round.h"
#include "trajopt/linalg/group_work.h"

namespace trajopt::linalg {

// A plan where the jobs can read it.
struct PlanEntries {
  const PlannedElimination* eliminations;
  const PlannedUpdate* updates;
};

// The failures have to be reset before. After one, the stages that follow do nothing.
template <class Executor, class T>
void sequence_factor(const Executor& run, const GroupPlan& plan, const PlanEntries& at,
                     const BasicGroupSystem<T>& s) {
  for (const PlannedLevel& level : plan.levels) {
    run(group::EliminateWork<T>{s, at.eliminations + level.eliminations_begin,
                                level.eliminations_end - level.eliminations_begin, level.stage});
    run(group::UpdateWork<T>{s, at.updates + level.updates_begin,
                             level.updates_end - level.updates_begin, level.stage});
  }
}

// Both sweeps over right-hand sides in the factors' own scalar type.
template <class Executor, class T>
void sequence_sweeps(const Executor& run, const GroupPlan& plan, const PlanEntries& at,
                     const BasicGroupSystem<T>& s, const BasicGroupVectors<T>& v) {
  for (const PlannedLevel& level : plan.levels) {
    run(group::ForwardWork<T>{s, v, at.eliminations + level.eliminations_begin,
                              level.eliminations_end - level.eliminations_begin});
    run(group::GatherWork<T>{s, v, at.updates + level.updates_begin,
                             level.fills_begin - level.updates_begin});
  }
  for (auto level = plan.levels.rbegin(); level != plan.levels.rend(); ++level) {
    run(group::BackwardWork<T>{s, v, at.eliminations + level->eliminations_begin,
                               level->eliminations_end - level->eliminations_begin});
  }
}

// Right-hand sides in float64; factors of another type need room to round them.
template <class Executor, class T>
void sequence_solve(const Executor& run, const GroupPlan& plan, const PlanEntries& at,
                    const BasicGroupSystem<T>& s, const GroupVectors& v,
                    const GroupRounding& room = {}) {
  if constexpr (std::is_same_v<T, double>) {
    sequence_sweeps(run, plan, at, s, v);
  } else {
    run(group::PeakWork{s.matrix(), v, room.peak});
    run(group::RoundWork{s.matrix(), v, room});
    sequence_sweeps(run, plan, at, s, BasicGroupVectors<T>{room.x, v.m, v.active});
    run(group::RestoreWork{s.matrix(), v, room});
  }
}

// Arrays of a refinement of (batch, blocks * size, m) values; lanes: batch * column_chunks(m).
struct RefineArrays {
  const double* rhs;
  double* r;
  double* saved;
  double* norm;  // lanes; zero on entry and on return
  GroupRefinement* states;
  int* active;
  GroupRounding room = {};  // of the solutions
};

// Up to the first residual.
template <class Executor>
void sequence_refine_start(const Executor& run, const GroupMatrix& s, double* x, int m,
                           int max_steps, double tolerance, const RefineArrays& a) {
  using Decide = group::DecideWork;
  const int chunks = column_chunks(m);
  run(group::ResidualWork{s, {nullptr, m, nullptr}, a.rhs, a.r, a.norm});
  run(Decide{Decide::When::scale, s, chunks, max_steps, tolerance, a.norm, a.states, a.active});
  run(group::ResidualWork{s, {x, m, nullptr}, a.rhs, a.r, a.norm});
  run(Decide{Decide::When::start, s, chunks, max_steps, tolerance, a.norm, a.states, a.active});
}

// One correction. At most max_steps of them change anything, so that many finish the refinement.
template <class Executor, class T>
void sequence_refine_step(const Executor& run, const GroupPlan& plan, const PlanEntries& at,
                          const BasicGroupSystem<T>& s, double* x, int m, int max_steps,
                          double tolerance, const RefineArrays& a) {
  using Decide = group::DecideWork;
  const int chunks = column_chunks(m);
  const GroupMatrix& matrix = s.matrix();
  const GroupVectors going_on{x, m, a.active};
  sequence_solve(run, plan, at, s, {a.r, m, a.active}, a.room);
  run(group::CorrectWork{matrix, going_on, a.r, a.saved, nullptr});
  run(group::ResidualWork{matrix, going_on, a.rhs, a.r, a.norm});
  run(Decide{Decide::When::step, matrix, chunks, max_steps, tolerance, a.norm, a.states, a.active});
  run(group::CorrectWork{matrix, {x, m, nullptr}, a.r, a.saved, a.states});
}

}  // namespace trajopt::linalg
