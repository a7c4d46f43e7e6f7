#include "trajopt/solver/paper_sqp.h"

#include <gtest/gtest.h>

#include "solver/flight.h"
#include "trajopt/solver/funnel_sqp.h"

namespace trajopt {
namespace {

class PaperSqp : public testing::TestWithParam<Formulation> {};

TEST_P(PaperSqp, SolvesByItsOwnRules) {
  test::Case c = test::make_flight(GetParam());
  Evaluation start;
  c.problem->evaluate(c.state, start);
  ASSERT_LE(start.constraint_norm, 1e-11);
  test::Recorder recorder;
  PaperOptions options;
  options.constraint_tolerance = 1e-8;
  const Result result = solve_paper(*c.problem, options, c.state, recorder.observer());
  EXPECT_EQ(result.status, Status::solved) << result.message;
  const auto& records = recorder.records;
  ASSERT_EQ(result.iterations, static_cast<int>(records.size()));

  Evaluation end;
  c.problem->evaluate(c.state, end);
  EXPECT_EQ(end.objective, records.back().objective);
  EXPECT_LT(end.objective, 0.5 * start.objective);
  EXPECT_LT(end.constraint_norm, options.constraint_tolerance);

  double objective = start.objective;
  for (std::size_t k = 0; k < records.size(); ++k) {
    const IterationRecord& r = records[k];
    EXPECT_EQ(r.iteration, static_cast<int>(k));
    EXPECT_LE(r.step_norm, r.radius * (1 + 1e-9));
    if (r.accepted) {
      EXPECT_LT(r.constraint_norm, options.constraint_limit);
    } else {
      EXPECT_EQ(r.objective, objective);
    }
    objective = r.objective;
    if (k + 1 == records.size()) break;
    EXPECT_GE(records[k + 1].penalty, r.penalty);
    EXPECT_DOUBLE_EQ(records[k + 1].radius, r.accepted ? 1.2 * r.radius : 0.8 * r.step_norm);
  }
}

// Both solvers end in nearly the same place, the funnel not above the paper. On the spline they end
// in two minima 2.8 % apart: tighter tolerances move neither.
TEST_P(PaperSqp, AgreesWithTheFunnel) {
  double objective[2];
  for (int k = 0; k < 2; ++k) {
    test::Case c = test::make_flight(GetParam());
    if (k == 0) {
      PaperOptions options;
      options.step_tolerance = 1e-6;
      const Result result = solve_paper(*c.problem, options, c.state, {});
      EXPECT_EQ(result.status, Status::solved) << result.message;
    } else {
      FunnelOptions options;
      options.objective_tolerance = 1e-6;
      const Result result = solve_funnel(*c.problem, options, c.state, {});
      EXPECT_EQ(result.status, Status::solved) << result.message;
    }
    Evaluation e;
    c.problem->evaluate(c.state, e);
    objective[k] = e.objective;
  }
  EXPECT_LE(objective[1], objective[0] * (1 + 1e-3));
  EXPECT_NEAR(objective[0], objective[1], 0.04 * objective[1]);
}

TEST_P(PaperSqp, SameBitsForAnyThreadCount) {
  State states[2];
  for (int threads : {1, 2}) {
    test::Case c = test::make_flight(GetParam(), threads);
    PaperOptions options;
    options.max_iterations = 4;
    options.ordering = linalg::Ordering::cyclic;
    solve_paper(*c.problem, options, c.state, {});
    states[threads - 1] = c.state;
  }
  EXPECT_EQ(states[0], states[1]);
}

// From a start that breaks physics C0 does not fit into the radius and has to be adjusted.
TEST_P(PaperSqp, RestoresABrokenStart) {
  test::Case c = test::make_flight(GetParam());
  test::Random random(12);
  State broken;
  c.problem->retract(
      c.state,
      random.vector(static_cast<std::size_t>(c.problem->nodes()) * c.problem->primal(), 0.02)
          .data(),
      broken);
  Evaluation start;
  c.problem->evaluate(broken, start);
  ASSERT_GT(start.constraint_norm, 0.1);
  PaperOptions options;
  options.constraint_limit = HUGE_VAL;
  options.max_iterations = 300;
  test::Recorder recorder;
  const Result result = solve_paper(*c.problem, options, broken, recorder.observer());
  EXPECT_LT(recorder.records.back().constraint_norm, 1e-4) << result.message;
}

TEST_P(PaperSqp, SaysWhyNothingWasAccepted) {
  test::Case c = test::make_flight(GetParam());
  const State before = c.state;
  PaperOptions options;
  options.constraint_limit = 1e-300;
  options.constraint_tolerance = 0;
  const Result result = solve_paper(*c.problem, options, c.state, {});
  EXPECT_EQ(result.status, Status::stalled);
  EXPECT_NE(result.message.find("no step was ever taken"), std::string::npos) << result.message;
  EXPECT_EQ(c.state, before);
}

TEST_P(PaperSqp, StopsOnRequest) {
  test::Case c = test::make_flight(GetParam());
  test::Recorder recorder;
  recorder.stop_after = 3;
  const Result result = solve_paper(*c.problem, {}, c.state, recorder.observer());
  EXPECT_EQ(result.status, Status::interrupted);
  EXPECT_EQ(result.iterations, 3);
}

TEST_P(PaperSqp, RefusesNotANumber) {
  test::Case c = test::make_flight(GetParam());
  c.state[0] = std::nan("");
  const Result result = solve_paper(*c.problem, {}, c.state, {});
  EXPECT_EQ(result.status, Status::numerical_failure);
}

TEST_P(PaperSqp, NamesTheOrderingItTook) {
  test::Case c = test::make_flight(GetParam());
  test::Recorder recorder;
  PaperOptions options;
  options.max_iterations = 1;
  const Result result = solve_paper(*c.problem, options, c.state, recorder.observer());
  EXPECT_NE(result.ordering, linalg::Ordering::automatic);
  ASSERT_EQ(recorder.records.size(), 1u);
  EXPECT_EQ(recorder.records[0].ordering, result.ordering);
}

INSTANTIATE_TEST_SUITE_P(Formulations, PaperSqp,
                         testing::Values(Formulation::frames, Formulation::spline),
                         [](const auto& info) {
                           return info.param == Formulation::frames ? "frames" : "spline";
                         });

}  // namespace
}  // namespace trajopt
