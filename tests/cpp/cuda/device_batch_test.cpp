// Batches on a GPU against single solves on the processor: every record and state, bit for bit. The
// same comparison without a GPU, with the same launches, is solver/batch_test.cpp.
#include <gtest/gtest.h>

#include <string>

#include "solver/batch_cases.h"
#include "trajopt/base/error.h"
#include "trajopt/cuda/solver/executor.h"

namespace trajopt {
namespace {

using test::Batch;
using test::make_member;

TEST(DeviceBatch, EveryProblemAsAlone) {
  for (int count : {1, 2, 3, 5}) {
    SCOPED_TRACE("batch of " + std::to_string(count));
    Batch batch(count);
    test::expect_as_alone(batch, solve_funnels(batch.items(), cuda::make_executor, {}));
  }
}

// Splines, rings, and problems with functions of the user.
TEST(DeviceBatch, OtherKindsAsAlone) {
  for (const auto& make :
       {test::make_spline_member, test::make_ring_member, test::make_function_member}) {
    Batch batch(5, make);
    test::expect_as_alone(batch, solve_funnels(batch.items(), cuda::make_executor, {}), make);
  }
}

// An objective without a minimum: no damping gives the matrix the right inertia.
test::Case make_hopeless() {
  test::Random random(1);
  const Model model = test::make_character();
  Objective objective = test::every_term(model, 13, random);
  for (double& weight : objective.local[0].weight) weight = -1e20;
  return test::make_case({.frames = 13, .turn = 0.01}, model, objective, random);
}

// It is said which pivot failed, in the processor's words, and the others go on.
TEST(DeviceBatch, FailuresStayWhereTheyAre) {
  const auto make = [](int k) { return k == 1 ? make_hopeless() : make_member(k); };
  Batch batch(4);
  batch.cases[1] = make_hopeless();
  batch.cases[2].state[5] = std::nan("");
  const auto ends = solve_funnels(batch.items(), cuda::make_executor, {});
  EXPECT_EQ(ends[1].result.status, Status::numerical_failure);
  EXPECT_NE(ends[1].result.message.find("pivot"), std::string::npos) << ends[1].result.message;
  EXPECT_EQ(ends[2].result.status, Status::numerical_failure);
  test::expect_as_alone(batch, ends, make);
}

// The same where the ring is closed.
TEST(DeviceBatch, SingularBorder) {
  const auto make = [](int k) {
    return k == 1 ? test::make_ring_without_minimum() : test::make_ring_member(k);
  };
  Batch batch(3, make);
  const auto ends = solve_funnels(batch.items(), cuda::make_executor, {});
  const std::string& message = ends[1].result.message;
  EXPECT_NE(message.find("of the border (block 5)"), std::string::npos) << message;
  test::expect_as_alone(batch, ends, make);
}

TEST(DeviceBatch, NoProblems) {
  EXPECT_TRUE(solve_funnels(std::vector<BatchItem>{}, cuda::make_executor, {}).empty());
}

}  // namespace
}  // namespace trajopt
