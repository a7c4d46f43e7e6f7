// Solves on a GPU against the processor's executor: every record and the state, bit for bit. The
// same comparison without a GPU, with the same launches, is solver/frames_executor_test.cpp.
#include <gtest/gtest.h>

#include <functional>
#include <stdexcept>

#include "solver/flight.h"
#include "solver/functions.h"
#include "solver/same_records.h"
#include "trajopt/cuda/solver/executor.h"
#include "trajopt/solver/batch.h"
#include "trajopt/solver/funnel_sqp.h"

namespace trajopt {
namespace {

using linalg::Ordering;

// Returns the number of iterations.
std::size_t compare(const std::function<test::Case()>& make, const FunnelOptions& options) {
  test::Case expected = make(), actual = make();
  test::Recorder on_cpu, on_device;
  const Result e = solve_funnel(*expected.problem, options, expected.state, on_cpu.observer());
  const auto executor =
      cuda::make_executor({{actual.problem.get(), &actual.state}}, executor_options(options));
  const Result a = solve_funnel(*executor, options, on_device.observer());
  EXPECT_EQ(a.message, e.message);
  test::expect_same_records(on_device.records, on_cpu.records);
  test::expect_same_state(actual.state, expected.state);
  return on_device.records.size();
}

TEST(DeviceExecutor, Flight) {
  for (Ordering ordering : {Ordering::cyclic, Ordering::sequential, Ordering::chunked}) {
    FunnelOptions options;
    options.ordering = ordering;
    for (Formulation formulation : {Formulation::frames, Formulation::spline})
      compare([=] { return test::make_flight(formulation); }, options);
  }
}

TEST(DeviceExecutor, EveryTerm) {
  for (const test::Named& named : test::all_setups()) {
    SCOPED_TRACE(named.name);
    FunnelOptions options;
    options.ordering = Ordering::cyclic;
    options.max_iterations = 30;
    options.funnel = 1e3;
    compare([&] { return test::make_case(named.setup); }, options);
  }
}

TEST(DeviceExecutor, HundredIterations) {
  FunnelOptions options;
  options.ordering = Ordering::cyclic;
  options.max_iterations = 100;
  options.funnel = 1e3;
  options.objective_tolerance = 0;
  compare([] { return test::make_case({.frames = 41, .turn = 0.02}); }, options);
}

TEST(DeviceExecutor, Spline) {
  FunnelOptions options;
  options.ordering = Ordering::cyclic;
  options.max_iterations = 60;
  options.funnel = 1e3;
  options.objective_tolerance = 0;
  const test::Setup setup{
      .formulation = Formulation::spline, .frames = 50, .frames_per_knot = 10, .turn = 0.02};
  EXPECT_GE(compare([&] { return test::make_case(setup); }, options), 60u);
}

TEST(DeviceExecutor, Ring) {
  for (bool uneven : {false, true}) {
    FunnelOptions options;
    options.ordering = Ordering::cyclic;
    options.max_iterations = 40;
    options.funnel = 1e3;
    options.objective_tolerance = 1e-6;
    const test::Setup setup{.frames = 24, .uneven = uneven, .periodic = true, .turn = 0.02};
    EXPECT_GE(compare([&] { return test::make_case(setup); }, options), 30u);
  }
}

TEST(DeviceExecutor, FunctionsOfTheUser) {
  for (const test::Setup& setup :
       {test::Setup{.frames = 24, .turn = 0.02},
        test::Setup{.frames = 24, .periodic = true, .turn = 0.02},
        test::Setup{.formulation = Formulation::spline, .frames = 25, .turn = 0.02}}) {
    FunnelOptions options;
    options.ordering = Ordering::cyclic;
    options.max_iterations = 40;
    options.funnel = 1e3;
    options.objective_tolerance = 1e-6;
    EXPECT_GE(compare([&] { return test::make_case_with_functions(setup); }, options), 30u);
  }
}

TEST(DeviceExecutor, AFunctionThatThrows) {
  for (int after : {0, 1, 2, 7}) {
    test::Case c = test::make_case_with_functions({}, 1, nullptr, after);
    const auto executor = cuda::make_executor({{c.problem.get(), &c.state}}, executor_options({}));
    EXPECT_THROW(solve_funnel(*executor, {}, {}), std::domain_error);
  }
}

// Sums of three levels.
TEST(DeviceExecutor, ManyFrames) {
  FunnelOptions options;
  options.ordering = Ordering::cyclic;
  options.max_iterations = 1;
  options.restore = false;
  options.funnel = 1e3;
  compare([] { return test::make_case({.frames = 64 * 64 + 1, .turn = 0.02}); }, options);
}

}  // namespace
}  // namespace trajopt
