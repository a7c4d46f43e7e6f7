#include "trajopt/solver/funnel_sqp.h"

#include <gtest/gtest.h>

#include "solver/flight.h"

namespace trajopt {
namespace {

class FunnelSqp : public testing::TestWithParam<Formulation> {};

TEST_P(FunnelSqp, SolvesToTheTolerance) {
  test::Case c = test::make_flight(GetParam());
  Evaluation start, end;
  c.problem->evaluate(c.state, start);
  test::Recorder recorder;
  const FunnelOptions options;
  const Result result = solve_funnel(*c.problem, options, c.state, recorder.observer());
  EXPECT_EQ(result.status, Status::solved) << result.message;
  c.problem->evaluate(c.state, end);
  EXPECT_EQ(end.objective, recorder.records.back().objective);
  EXPECT_LT(end.objective, 0.5 * start.objective);
  EXPECT_LE(end.constraint_norm, options.constraint_tolerance);
}

TEST_P(FunnelSqp, SameBitsForAnyThreadCount) {
  for (linalg::Ordering ordering :
       {linalg::Ordering::sequential, linalg::Ordering::cyclic, linalg::Ordering::chunked}) {
    State states[2];
    for (int threads : {1, 2}) {
      test::Case c = test::make_flight(GetParam(), threads);
      FunnelOptions options;
      options.max_iterations = 5;
      options.ordering = ordering;
      solve_funnel(*c.problem, options, c.state, {});
      states[threads - 1] = c.state;
    }
    EXPECT_EQ(states[0], states[1]) << linalg::ordering_name(ordering);
  }
}

TEST_P(FunnelSqp, StopsOnRequest) {
  test::Case c = test::make_flight(GetParam());
  test::Recorder recorder;
  recorder.stop_after = 2;
  const Result result = solve_funnel(*c.problem, {}, c.state, recorder.observer());
  EXPECT_EQ(result.status, Status::interrupted);
  EXPECT_EQ(result.iterations, 2);
}

TEST_P(FunnelSqp, RefusesNotANumber) {
  test::Case c = test::make_flight(GetParam());
  c.state[0] = std::nan("");
  EXPECT_EQ(solve_funnel(*c.problem, {}, c.state, {}).status, Status::numerical_failure);
}

// In the result and in every record, also where nothing was factored.
TEST_P(FunnelSqp, NamesTheOrderingItTook) {
  using linalg::Ordering;
  const bool frames = GetParam() == Formulation::frames;
  for (Ordering asked : {Ordering::automatic, Ordering::cyclic}) {
    test::Case c = test::make_flight(GetParam());
    test::Recorder recorder;
    FunnelOptions options;
    options.max_iterations = 2;
    options.ordering = asked;
    const Result result = solve_funnel(*c.problem, options, c.state, recorder.observer());
    const Ordering expected = asked == Ordering::cyclic ? asked
                              : frames                  ? Ordering::frontal
                                                        : Ordering::sequential;  // two blocks
    EXPECT_EQ(result.ordering, expected) << linalg::ordering_name(result.ordering);
    ASSERT_FALSE(recorder.records.empty());
    for (const IterationRecord& r : recorder.records) EXPECT_EQ(r.ordering, expected);
    c.state[0] = std::nan("");
    EXPECT_EQ(solve_funnel(*c.problem, options, c.state, {}).ordering, expected);
  }
}

INSTANTIATE_TEST_SUITE_P(Formulations, FunnelSqp,
                         testing::Values(Formulation::frames, Formulation::spline),
                         [](const auto& info) {
                           return info.param == Formulation::frames ? "frames" : "spline";
                         });

}  // namespace
}  // namespace trajopt
