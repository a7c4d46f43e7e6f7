// Batches of problems of one shape, and the comparison of each with its solve alone.
#pragma once

#include <functional>
#include <utility>

#include "solver/flight.h"
#include "solver/functions.h"
#include "solver/same_records.h"
#include "trajopt/solver/batch.h"

namespace trajopt::test {

inline FunnelOptions options_for(int iterations) {
  FunnelOptions options;
  options.ordering = linalg::Ordering::cyclic;
  options.max_iterations = iterations;
  options.funnel = 1e3;
  return options;
}

// Problems of one shape that differ in pose, targets, weights, steps and time scheme, and go
// different ways: the wilder the start, the more steps are refused.
inline Case make_member(int k) {
  Setup setup{.frames = 13, .uneven = k % 3 == 1, .turn = 0.01 + 0.01 * k};
  if (k % 2 == 1) setup.integrator = Integrator::verlet;
  return make_case(setup, 3 + k);
}

inline Case make_spline_member(int k) {
  return make_case({.formulation = Formulation::spline,
                    .frames = 15,
                    .uneven = k % 3 == 1,
                    .turn = 0.01 + 0.01 * k},
                   3 + k);
}

inline Case make_ring_member(int k) {
  return make_case({.frames = 12, .uneven = k % 3 == 1, .periodic = true, .turn = 0.01 + 0.01 * k},
                   3 + k);
}

// One whose last two frames, the border, want to be infinitely far from a pose.
inline Case make_ring_without_minimum() {
  Random random(1);
  const Setup setup{.frames = 12, .periodic = true, .turn = 0.01};
  const Model model = make_character();
  Objective objective = every_term(model, setup.frames, random);
  objective.local[0].weight.back() = -1e20;
  return make_case(setup, model, objective, random);
}

// Also of one shape, although their functions have different numbers of rows.
inline Case make_function_member(int k) {
  Random random(3 + k);
  const int frames = 13;
  const Model model = make_character();
  Objective objective = every_term(model, frames, random);
  objective.callbacks.push_back(height_function(model, frames, 0.1 * k));
  objective.callbacks.push_back(speed_function(model, frames, 0.2));
  if (k % 2 == 1) std::swap(objective.callbacks[0], objective.callbacks[1]);
  if (k % 3 == 2) objective.callbacks[0] = objective.callbacks[1];
  return make_case({.frames = frames, .turn = 0.01 + 0.01 * k}, model, objective, random);
}

struct Batch {
  std::vector<Case> cases;
  std::vector<Recorder> recorders;
  std::vector<FunnelOptions> options;
  std::vector<State> starts;  // when items() was called

  explicit Batch(int count, const std::function<Case(int)>& make = make_member) : recorders(count) {
    for (int k = 0; k < count; ++k) {
      cases.push_back(make(k));
      options.push_back(options_for(3 + 2 * k));
    }
  }
  std::vector<BatchItem> items() {
    std::vector<BatchItem> all;
    for (const Case& c : cases) starts.push_back(c.state);
    for (std::size_t k = 0; k < cases.size(); ++k) {
      all.push_back({{cases[k].problem.get(), &cases[k].state},
                     options[k],
                     report_to(recorders[k].observer())});
    }
    return all;
  }
};

// Every problem of the batch by itself, on the processor.
inline void expect_as_alone(const Batch& batch, const std::vector<BatchEnd>& ends,
                            const std::function<Case(int)>& make = make_member) {
  ASSERT_EQ(ends.size(), batch.cases.size());
  for (std::size_t k = 0; k < ends.size(); ++k) {
    SCOPED_TRACE("problem " + std::to_string(k));
    ASSERT_FALSE(ends[k].error);
    Case alone = make(static_cast<int>(k));
    alone.state = batch.starts[k];
    Recorder recorder;
    recorder.stop_after = batch.recorders[k].stop_after;
    const Result expected =
        solve_funnel(*alone.problem, batch.options[k], alone.state, recorder.observer());
    EXPECT_EQ(ends[k].result.status, expected.status);
    EXPECT_EQ(ends[k].result.message, expected.message);
    EXPECT_EQ(ends[k].result.iterations, expected.iterations);
    expect_same_records(batch.recorders[k].records, recorder.records);
    expect_same_state(batch.cases[k].state, alone.state);
  }
}

}  // namespace trajopt::test
