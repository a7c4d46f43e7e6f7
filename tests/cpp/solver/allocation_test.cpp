// An iteration runs hundreds of times a second: once its vectors exist it must not allocate.
#include <gtest/gtest.h>

#include "counting_allocator.h"
#include "solver/flight.h"
#include "trajopt/solver/funnel_sqp.h"

namespace trajopt {
namespace {

// Allocations by iteration, steps taken and refused among them.
struct Count {
  std::vector<long> after;
  int accepted = 0, refused = 0;
};

Count count_allocations(test::Case c, const FunnelOptions& options) {
  Count count;
  count.after.reserve(1000);
  solve_funnel(*c.problem, options, c.state, [&](const IterationRecord& record, const State&) {
    if (count.after.size() >= 3) ++(record.accepted ? count.accepted : count.refused);
    count.after.push_back(test::allocations);
    return count.after.size() < 21;
  });
  return count;
}

TEST(Allocation, NoneInAnIteration) {
  for (Formulation formulation : {Formulation::frames, Formulation::spline}) {
    for (int threads : {1, 2}) {
      FunnelOptions options;
      options.damping = 1e-9;  // so that steps are too long at first: some are refused
      options.objective_tolerance = 0;
      options.window = 100;
      const Count count = count_allocations(test::make_flight(formulation, threads), options);
      ASSERT_EQ(count.after.size(), 21u);
      EXPECT_GT(count.accepted, 0);
      for (std::size_t k = 3; k < count.after.size(); ++k)
        EXPECT_EQ(count.after[k] - count.after[k - 1], 0) << "iteration " << k;
    }
  }
}

TEST(Allocation, NoneWithContactsAndEveryTerm) {
  FunnelOptions options;
  options.objective_tolerance = 0;
  options.window = 100;
  options.funnel = 1e3;
  for (bool periodic : {false, true}) {
    const Count count = count_allocations(
        test::make_case({.frames = 30, .periodic = periodic, .turn = 0.02}), options);
    ASSERT_EQ(count.after.size(), 21u);
    EXPECT_GT(count.accepted, 0);
    EXPECT_GT(count.refused, 0);
    for (std::size_t k = 3; k < count.after.size(); ++k)
      EXPECT_EQ(count.after[k] - count.after[k - 1], 0) << "iteration " << k;
  }
}

}  // namespace
}  // namespace trajopt
