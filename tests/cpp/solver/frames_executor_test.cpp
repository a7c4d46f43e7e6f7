// A solve by launches, as a GPU makes them, against the processor's executor: every record and the
// state bit for bit, with ranks and jobs in either order.
#include "trajopt/solver/frames_executor.h"

#include <gtest/gtest.h>

#include <functional>
#include <stdexcept>

#include "solver/flight.h"
#include "solver/functions.h"
#include "solver/same_records.h"
#include "solver/serial_device.h"
#include "trajopt/solver/batch.h"

namespace trajopt {
namespace {

using linalg::Ordering;

// Both executors on the same case; returns the records.
std::vector<IterationRecord> compare(const std::function<test::Case()>& make,
                                     const FunnelOptions& options, test::LaunchOrder how,
                                     int most_lanes) {
  test::Case expected = make(), actual = make();
  test::Recorder on_cpu, on_device;
  const Result e = solve_funnel(*expected.problem, options, expected.state, on_cpu.observer());
  FramesExecutor<test::SerialDevice> executor(test::SerialDevice(how),
                                              {{actual.problem.get(), &actual.state}},
                                              executor_options(options), most_lanes);
  const Result a = solve_funnel(executor, options, on_device.observer());
  EXPECT_EQ(a.status, e.status) << a.message << "; on the processor: " << e.message;
  EXPECT_EQ(a.message, e.message);
  EXPECT_EQ(a.ordering, e.ordering);
  test::expect_same_records(on_device.records, on_cpu.records);
  test::expect_same_state(actual.state, expected.state);
  return on_cpu.records;
}

int refused(const std::vector<IterationRecord>& records) {
  int count = 0;
  for (const IterationRecord& r : records) count += !r.accepted;
  return count;
}

TEST(FramesExecutor, FlightToTheEnd) {
  for (Ordering ordering : {Ordering::cyclic, Ordering::chunked}) {
    FunnelOptions options;
    options.ordering = ordering;
    for (Formulation formulation : {Formulation::frames, Formulation::spline}) {
      const auto records = compare([=] { return test::make_flight(formulation); }, options,
                                   {RankOrder::forward, 0}, 64);
      EXPECT_GT(records.size(), 10u);
    }
  }
}

// Contacts, balls and every term, steps taken and refused; odd counts, uneven steps.
TEST(FramesExecutor, EveryTerm) {
  int count = 0;
  for (const test::Named& named : test::all_setups()) {
    SCOPED_TRACE(named.name);
    ++count;
    for (test::LaunchOrder how :
         {test::LaunchOrder{RankOrder::forward, 0}, test::LaunchOrder{RankOrder::reverse, 0},
          test::LaunchOrder{RankOrder::forward, 1}}) {
      FunnelOptions options;
      options.ordering = Ordering::cyclic;
      options.max_iterations = 12;
      options.funnel = 1e3;
      test::Setup setup = named.setup;
      setup.turn = std::min(setup.turn, 0.05);
      // Fewer lanes than frames: a rank does several.
      const auto records = compare([&] { return test::make_case(setup); }, options, how, 7);
      EXPECT_GT(records.size(), 0u);
    }
  }
  EXPECT_EQ(count, 12);
}

// A hundred iterations among contacts.
TEST(FramesExecutor, HundredIterations) {
  FunnelOptions options;
  options.ordering = Ordering::cyclic;
  options.max_iterations = 100;
  options.funnel = 1e3;
  options.objective_tolerance = 0;
  const auto records = compare([] { return test::make_case({.frames = 41, .turn = 0.02}); },
                               options, {RankOrder::reverse, 0}, 16);
  EXPECT_GE(records.size(), 100u);
  EXPECT_GT(refused(records), 0);
}

// The same for splines, a control point every second frame and fewer.
TEST(FramesExecutor, Spline) {
  for (int per_knot : {2, 5, 10}) {
    SCOPED_TRACE(std::to_string(per_knot) + " frames a knot");
    FunnelOptions options;
    options.ordering = Ordering::cyclic;
    options.max_iterations = per_knot == 10 ? 100 : 40;
    options.funnel = 1e3;
    options.objective_tolerance = 0;
    const test::Setup setup{.formulation = Formulation::spline,
                            .frames = 30,
                            .frames_per_knot = per_knot,
                            .turn = 0.02};
    const auto records =
        compare([&] { return test::make_case(setup); }, options, {RankOrder::reverse, 0}, 16);
    EXPECT_GE(records.size(), 40u);
    EXPECT_GT(refused(records), 0);
  }
}

// A job with one frame, two and four of them at a time, the last of them incomplete.
TEST(FramesExecutor, FramesOfAJob) {
  FunnelOptions options;
  options.ordering = Ordering::cyclic;
  options.max_iterations = 1;
  options.funnel = 1e3;
  for (int lanes : {101, 151, 301}) {
    SCOPED_TRACE(std::to_string(lanes) + " lanes");
    compare([] { return test::make_case({.frames = 301, .turn = 0.02}); }, options,
            {RankOrder::reverse, 0}, lanes);
  }
}

// One block, two, and the first odd count; the shortest ring.
TEST(FramesExecutor, ShortMotions) {
  FunnelOptions options;
  options.ordering = Ordering::cyclic;
  options.max_iterations = 5;
  options.funnel = 1e3;
  std::vector<test::Setup> setups = {{.frames = 8, .periodic = true, .turn = 0.02}};
  for (int nodes : {1, 2, 3}) {
    setups.push_back({.frames = nodes, .turn = 0.02});
    setups.push_back({.formulation = Formulation::spline,
                      .frames = 2 * nodes,
                      .frames_per_knot = 2,
                      .turn = 0.02});
  }
  for (const test::Setup& setup : setups) {
    SCOPED_TRACE(std::to_string(setup.frames) + " frames");
    const auto records = compare([&] { return test::make_case_with_functions(setup); }, options,
                                 {RankOrder::reverse, 0}, 7);
    EXPECT_GT(records.size(), 1u);
  }
}

// A gait on the way to where it repeats itself: the frames of the ring's seam differ by the stride.
TEST(FramesExecutor, Ring) {
  for (Ordering ordering : {Ordering::cyclic, Ordering::chunked}) {
    for (bool uneven : {false, true}) {
      FunnelOptions options;
      options.ordering = ordering;
      options.max_iterations = 40;
      options.funnel = 1e3;
      options.objective_tolerance = 1e-6;
      const test::Setup setup{.frames = 24, .uneven = uneven, .periodic = true, .turn = 0.02};
      const auto records =
          compare([&] { return test::make_case(setup); }, options, {RankOrder::reverse, 0}, 7);
      EXPECT_GE(records.size(), 30u);
    }
  }
}

TEST(FramesExecutor, FunctionsOfTheUser) {
  for (const test::Setup& setup :
       {test::Setup{.frames = 13, .turn = 0.02},
        test::Setup{.frames = 16, .periodic = true, .turn = 0.02},
        test::Setup{.formulation = Formulation::spline, .frames = 25, .turn = 0.02}}) {
    FunnelOptions options;
    options.ordering = Ordering::cyclic;
    options.max_iterations = 40;
    options.funnel = 1e3;
    options.objective_tolerance = 1e-6;
    int calls = 0;
    const auto records = compare([&] { return test::make_case_with_functions(setup, 1, &calls); },
                                 options, {RankOrder::reverse, 0}, 7);
    EXPECT_GE(records.size(), 30u);
    EXPECT_GT(calls, 60);
    EXPECT_GT(records[0].terms.back(), 0.0);
  }
}

// It is not caught where it would be taken for something else.
TEST(FramesExecutor, AFunctionThatThrows) {
  for (int after : {0, 1, 2, 7}) {
    test::Case c = test::make_case_with_functions({}, 1, nullptr, after);
    FramesExecutor<test::SerialDevice> executor(
        test::SerialDevice({}), {{c.problem.get(), &c.state}}, executor_options({}));
    try {
      solve_funnel(executor, {}, {});
      ADD_FAILURE();
    } catch (const std::domain_error& error) {
      EXPECT_STREQ(error.what(), "not here");
    }
  }
}

// A matrix of the wrong inertia: the failure is noticed, the damping raised.
TEST(FramesExecutor, WrongInertia) {
  FunnelOptions options;
  options.ordering = Ordering::cyclic;
  options.max_iterations = 3;
  options.damping = -1e6;
  for (Formulation formulation : {Formulation::frames, Formulation::spline})
    compare([=] { return test::make_flight(formulation); }, options, {RankOrder::forward, 0}, 64);
}

}  // namespace
}  // namespace trajopt
