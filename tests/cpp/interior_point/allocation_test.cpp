// Between the first and the last iteration nothing is allocated.
#include <gtest/gtest.h>

#include "counting_allocator.h"
#include "interior_point/analytic.h"

namespace trajopt::interior_point {
namespace {

TEST(Allocation, NoneInTheIterations) {
  using test::Analytic;
  using test::Sample;
  constexpr int kStages = 20;
  Analytic a(kStages + 1, 2, 1);
  a.add(a.problem.stages, 2, kStages, {0}, {0}, [](int, Sample& s, double f, const double* l) {
    const double u = s.v[1], p = s.v[4];
    s.cost = 0.05 * u * u;
    s.gradient[1] = 0.1 * u;
    s.c[0] = s.v[2] - s.v[0] - 0.05 * u * p;
    s.jacobian[0] = -1;
    s.jacobian[1] = -0.05 * p;
    s.jacobian[2] = 1;
    s.jacobian[4] = -0.05 * u;
    s.hessian[1 * 5 + 1] = 0.1 * f;
    s.hessian[4 * 5 + 1] = -0.05 * l[0];
  });
  a.problem.lower[0] = a.problem.upper[0] = 0;
  a.problem.lower[2 * kStages] = a.problem.upper[2 * kStages] = 1;
  a.problem.lower[2 * kStages + 2] = 0.5;
  a.problem.upper[2 * kStages + 2] = 2.0;
  for (int k = 0; k <= kStages; ++k) a.problem.upper[2 * k + 1] = 0.8;
  Point point{std::vector<double>(2 * kStages + 3, 0.3), {}, {}};
  point.x.back() = 1.0;
  long first = 0, last = 0;
  const Outcome out = a.solve(point, {}, [&](const Record& r, const double*) {
    if (r.iteration == 1) first = trajopt::test::allocations;
    last = trajopt::test::allocations;
    return true;
  });
  EXPECT_EQ(out.status, Status::solved) << out.message;
  EXPECT_GT(out.iterations, 3);
  EXPECT_EQ(last - first, 0);
}

}  // namespace
}  // namespace trajopt::interior_point
