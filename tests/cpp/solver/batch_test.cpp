// Batches by launches, as a GPU makes them, against single solves on the processor: every record
// and state bit for bit, whatever the others of the batch do.
#include "trajopt/solver/batch.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <stdexcept>

#include "solver/batch_cases.h"
#include "solver/serial_device.h"

namespace trajopt {
namespace {

using test::Batch;
using test::make_member;
using test::options_for;

// Makes executors on the serial device, and counts them.
struct Maker {
  test::LaunchOrder how;
  int most_lanes = 1 << 14;
  std::size_t most_members = 1000;  // that the memory holds
  std::vector<std::size_t> made;

  MakeBatchExecutor function() {
    return [this](const std::vector<BatchMember>& members, const ExecutorOptions& options) {
      if (members.size() > most_members) throw DeviceMemoryError("asked for too much");
      made.push_back(members.size());
      return std::make_unique<FramesExecutor<test::SerialDevice>>(test::SerialDevice(how), members,
                                                                  options, most_lanes);
    };
  }
};

TEST(Batch, EveryProblemAsAlone) {
  for (int count : {1, 2, 3, 5, 8}) {
    for (test::LaunchOrder how :
         {test::LaunchOrder{RankOrder::forward, 0}, test::LaunchOrder{RankOrder::reverse, 0},
          test::LaunchOrder{RankOrder::forward, 1}}) {
      SCOPED_TRACE("batch of " + std::to_string(count));
      Batch batch(count);
      Maker maker{how, 7, 1000, {}};
      const auto ends = solve_funnels(batch.items(), maker.function(), {});
      EXPECT_EQ(maker.made, std::vector<std::size_t>{static_cast<std::size_t>(count)});
      test::expect_as_alone(batch, ends);
    }
  }
}

// Splines, rings, and problems with functions of the user: some end while others go on.
TEST(Batch, OtherKindsAsAlone) {
  for (const auto& make :
       {test::make_spline_member, test::make_ring_member, test::make_function_member}) {
    for (test::LaunchOrder how :
         {test::LaunchOrder{RankOrder::forward, 0}, test::LaunchOrder{RankOrder::reverse, 0}}) {
      Batch batch(5, make);
      Maker maker{how, 7, 1000, {}};
      const auto ends = solve_funnels(batch.items(), maker.function(), {});
      EXPECT_EQ(maker.made, std::vector<std::size_t>{5});
      test::expect_as_alone(batch, ends, make);
    }
  }
}

// Who has ended is not asked for values any more, and who throws does not keep the others.
TEST(Batch, FunctionsOfTheUserAreCalledAsAlone) {
  int calls[3] = {}, alone[3] = {};
  const auto make = [](int k, int* count) {
    return test::make_case_with_functions({.frames = 13, .turn = 0.02}, 3 + k, count,
                                          k == 1 ? 4 : -1);
  };
  Batch batch(3, [&](int k) { return make(k, calls + k); });
  batch.options[2].max_iterations = 30;
  Maker maker;
  const auto ends = solve_funnels(batch.items(), maker.function(), {});
  ASSERT_TRUE(ends[1].error);
  EXPECT_THROW(std::rethrow_exception(ends[1].error), std::domain_error);
  for (int k : {0, 2}) {
    SCOPED_TRACE("problem " + std::to_string(k));
    EXPECT_FALSE(ends[k].error);
    test::Case c = make(k, alone + k);
    test::Recorder recorder;
    solve_funnel(*c.problem, batch.options[k], c.state, recorder.observer());
    test::expect_same_records(batch.recorders[k].records, recorder.records);
    test::expect_same_state(batch.cases[k].state, c.state);
    EXPECT_EQ(calls[k], alone[k]);
  }
  EXPECT_EQ(calls[1], 4);
}

TEST(Batch, DifferentEndsAreMet) {
  Batch batch(5);
  Maker maker;
  const auto ends = solve_funnels(batch.items(), maker.function(), {});
  std::vector<int> iterations;
  for (const BatchEnd& end : ends) iterations.push_back(end.result.iterations);
  const auto [least, most] = std::minmax_element(iterations.begin(), iterations.end());
  EXPECT_GT(*most, *least + 4);
  int accepted = 0, refused = 0;
  for (const test::Recorder& r : batch.recorders)
    for (const IterationRecord& record : r.records) ++(record.accepted ? accepted : refused);
  EXPECT_GT(accepted, 0);
  EXPECT_GT(refused, 0);
}

TEST(Batch, NoProblemsMakeNoExecutor) {
  Batch batch(0);
  Maker maker;
  EXPECT_TRUE(solve_funnels(batch.items(), maker.function(), {}).empty());
  EXPECT_TRUE(maker.made.empty());
}

// A matrix of the wrong inertia, a start that is not a number, a report that throws and one that
// stops: each ends its own problem.
TEST(Batch, FailuresStayWhereTheyAre) {
  Batch batch(6);
  batch.options[1].damping = -1e6;
  batch.options[1].max_iterations = 3;
  batch.cases[2].state[5] = std::nan("");
  batch.recorders[4].stop_after = 2;
  std::vector<BatchItem> items = batch.items();
  items[3].report = [](const IterationRecord& record, SqpPoint&) -> bool {
    if (record.iteration == 1) throw std::runtime_error("mine");
    return true;
  };
  Maker maker;
  const auto ends = solve_funnels(items, maker.function(), {});
  EXPECT_EQ(ends[2].result.status, Status::numerical_failure);
  EXPECT_EQ(ends[2].result.message, "the initial guess gives values that are not finite");
  ASSERT_TRUE(ends[3].error);
  try {
    std::rethrow_exception(ends[3].error);
  } catch (const std::runtime_error& error) {
    EXPECT_STREQ(error.what(), "mine");
  }
  EXPECT_EQ(ends[4].result.status, Status::interrupted);
  for (int k : {0, 1, 4, 5}) {
    SCOPED_TRACE("problem " + std::to_string(k));
    test::Case alone = make_member(k);
    test::Recorder recorder;
    recorder.stop_after = batch.recorders[k].stop_after;
    solve_funnel(*alone.problem, batch.options[k], alone.state, recorder.observer());
    test::expect_same_records(batch.recorders[k].records, recorder.records);
    test::expect_same_state(batch.cases[k].state, alone.state);
  }
}

// What does not fit into the memory together is solved in parts.
TEST(Batch, SplitWhereTheMemoryIsShort) {
  Batch batch(7);
  Maker maker;
  maker.most_members = 3;
  const auto ends = solve_funnels(batch.items(), maker.function(), {});
  EXPECT_EQ(maker.made, (std::vector<std::size_t>{2, 2, 2, 1}));
  test::expect_as_alone(batch, ends);
}

TEST(Batch, NotEvenOneFits) {
  Batch batch(3);
  Maker maker;
  maker.most_members = 0;
  for (const BatchEnd& end : solve_funnels(batch.items(), maker.function(), {})) {
    ASSERT_TRUE(end.error);
    EXPECT_THROW(std::rethrow_exception(end.error), DeviceMemoryError);
  }
}

// Problems of other shapes go to an executor of their own.
TEST(Batch, GroupedByShape) {
  const Formulation spline = Formulation::spline;
  test::Case cases[] = {
      make_member(0),
      test::make_flight(Formulation::frames),
      make_member(1),
      test::make_case({.periodic = true}),
      test::make_flight(Formulation::frames),
      test::make_flight(spline),
      test::make_case({.formulation = spline, .frames = 20}),
      test::make_case({.formulation = spline, .frames = 20}, 2),
      test::make_case({.formulation = spline, .frames = 20, .frames_per_knot = 10})};
  std::vector<BatchItem> items;
  for (test::Case& c : cases) items.push_back({{c.problem.get(), &c.state}, options_for(4), {}});
  EXPECT_TRUE(same_shape(items[0], items[2]));
  EXPECT_FALSE(same_shape(items[0], items[1]));
  EXPECT_FALSE(same_shape(items[1], items[5]));
  EXPECT_FALSE(same_shape(items[6], items[8]));
  Maker maker;
  const auto ends = solve_funnels(items, maker.function(), {});
  EXPECT_EQ(maker.made, (std::vector<std::size_t>{2, 2, 1, 1, 2, 1}));
  for (const BatchEnd& end : ends) EXPECT_FALSE(end.error);
}

TEST(Batch, PollIsCalledAndMayStopEverything) {
  Batch batch(3);
  Maker maker;
  int calls = 0;
  solve_funnels(batch.items(), maker.function(), [&] { ++calls; });
  EXPECT_GT(calls, 3);
  const auto stop = [] { throw std::runtime_error("enough"); };
  EXPECT_THROW(solve_funnels(batch.items(), maker.function(), stop), std::runtime_error);
}

}  // namespace
}  // namespace trajopt
