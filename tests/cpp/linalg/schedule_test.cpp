#include "trajopt/linalg/schedule.h"

#include <gtest/gtest.h>

#include <set>

namespace trajopt::linalg {
namespace {

// Every block goes once; runs of a stage never write to one block before the barrier.
void expect_valid(const Schedule& schedule, int blocks) {
  std::set<int> gone;
  for (const Stage& stage : schedule.stages) {
    std::set<int> written;  // by earlier runs of this stage
    for (int r = stage.begin; r < stage.end; ++r) {
      std::set<int> mine;
      for (int s = schedule.runs[r].begin; s < schedule.runs[r].end; ++s) {
        const Step& step = schedule.steps[s];
        EXPECT_TRUE(gone.insert(step.block).second) << "block " << step.block << " twice";
        EXPECT_LT(step.left, step.block);
        EXPECT_TRUE(step.right < 0 || step.right > step.block);
        mine.insert(step.block);
        if (step.right >= 0) mine.insert(step.right);
        if (step.left >= 0 && !step.left_deferred) mine.insert(step.left);
      }
      for (int block : mine) EXPECT_TRUE(written.insert(block).second) << "race on " << block;
    }
  }
  EXPECT_EQ(static_cast<int>(gone.size()), blocks);
}

TEST(Schedule, CoversEveryBlockWithoutRaces) {
  for (int blocks : {1, 2, 3, 4, 5, 7, 8, 16, 17, 100}) {
    expect_valid(make_schedule(blocks, Ordering::sequential, 1), blocks);
    expect_valid(make_schedule(blocks, Ordering::cyclic, 1), blocks);
    for (int chunks : {1, 2, 3, 4, 7, 1000}) {
      expect_valid(make_schedule(blocks, Ordering::chunked, chunks), blocks);
    }
  }
}

TEST(Schedule, CyclicHasLogarithmicDepth) {
  EXPECT_EQ(make_schedule(64, Ordering::cyclic, 1).stages.size(), 7u);
  EXPECT_EQ(make_schedule(64, Ordering::cyclic, 1).max_runs(), 32);
}

TEST(Schedule, TwoSweepsMeetWithoutFill) {
  const Schedule schedule = make_schedule(101, Ordering::chunked, 2);
  ASSERT_EQ(schedule.stages.size(), 2u);
  EXPECT_EQ(schedule.runs.size(), 3u);
  EXPECT_EQ(schedule.steps.back().block, 48);  // the upward sweep costs 1.1 of the other a block
  for (const Step& step : schedule.steps) EXPECT_TRUE(step.left < 0 || step.right < 0);
}

}  // namespace
}  // namespace trajopt::linalg
