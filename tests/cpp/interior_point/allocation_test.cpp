// Between the first and the last iteration nothing is allocated.
#include <gtest/gtest.h>

#include "counting_allocator.h"
#include "interior_point/analytic.h"

namespace trajopt::interior_point {
namespace {

using test::Analytic;
using test::Sample;

struct Counted {
  Outcome outcome;
  long allocations = 0;  // from iteration 1 to the last
  int corrected = 0;     // iterations whose matrix had to be regularized
};

Counted count(Analytic& a, Point& point, BarrierRule rule = BarrierRule::monotone) {
  Counted c;
  long first = 0;
  c.outcome = a.solve(point, {.barrier_rule = rule}, [&](const Record& r, const double*) {
    if (r.iteration == 1) first = trajopt::test::allocations;
    c.allocations = trajopt::test::allocations - first;
    c.corrected += r.iteration > 1 && r.regularization > 0.0;
    return true;
  });
  return c;
}

TEST(Allocation, NoneInTheIterations) {
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

// x_{k+1} = x_k + 0.1 u_k with a cost of two wells in u, concave between them, where the start is,
// and one unknown of every node that nothing sees: indefinite and singular matrices, with and
// without a border.
void expect_corrections(int globals, BarrierRule rule = BarrierRule::monotone) {
  constexpr int kStages = 12, kSize = 3;
  Analytic a(kStages + 1, kSize, globals);
  const int locals = 2 * kSize + globals;
  a.add(a.problem.stages, 2, kStages, {0}, {0}, [=](int k, Sample& s, double f, const double*) {
    const double u = s.v[1], p = globals > 0 ? s.v[2 * kSize] : 0.0;
    const double aim = 1.0 + 0.1 * p + 0.01 * k;
    s.cost = (u * u - aim * aim) * (u * u - aim * aim);
    s.gradient[1] = 4 * u * (u * u - aim * aim);
    s.hessian[1 * locals + 1] = f * (12 * u * u - 4 * aim * aim);
    s.c[0] = s.v[kSize] - s.v[0] - 0.1 * u;
    s.jacobian[0] = -1;
    s.jacobian[1] = -0.1;
    s.jacobian[kSize] = 1;
    if (globals == 0) return;
    s.gradient[2 * kSize] = -0.4 * aim * (u * u - aim * aim);
    s.hessian[2 * kSize * locals + 1] = -0.8 * f * u * aim;
    s.hessian[2 * kSize * locals + 2 * kSize] = f * 0.04 * (3 * aim * aim - u * u);
  });
  a.problem.lower[0] = a.problem.upper[0] = 0;
  for (int k = 0; k < kStages; ++k) a.problem.upper[kSize * k + 1] = 3.0;
  Point point{std::vector<double>(a.problem.variables(), 0.05), {}, {}};
  const Counted c = count(a, point, rule);
  EXPECT_EQ(c.outcome.status, Status::solved) << c.outcome.message;
  EXPECT_GT(c.corrected, 2);
  EXPECT_EQ(c.allocations, 0);
}

TEST(Allocation, NoneWhereTheMatrixIsIndefiniteOrSingular) { expect_corrections(0); }
TEST(Allocation, NoneWhereTheBorderedMatrixIs) { expect_corrections(1); }
TEST(Allocation, NoneUnderTheAdaptiveRule) { expect_corrections(0, BarrierRule::adaptive); }

}  // namespace
}  // namespace trajopt::interior_point
