// Problems with known solutions, solvable and not.
#include "trajopt/interior_point/interior_point.h"

#include <gtest/gtest.h>

#include <cmath>

#include "interior_point/analytic.h"
#include "trajopt/base/error.h"

namespace trajopt::interior_point {
namespace {

using test::Analytic;
using test::kInf;
using test::Sample;

// x_{k+1} = x_k + u_k / n, cost u^2 / n from x_0 = 0 to x_n = 1: u = 1 everywhere, cost 1,
// multipliers of the dynamics 2 u.
void add_integrator(Analytic& a, int stages) {
  const double h = 1.0 / stages;
  a.add(a.problem.stages, 2, stages, {0}, {0}, [h](int, Sample& s, double factor, const double*) {
    const double u = s.v[1];
    s.cost = h * u * u;
    s.gradient[1] = 2 * h * u;
    s.c[0] = s.v[2] - s.v[0] - h * u;
    s.jacobian[2] = 1;
    s.jacobian[0] = -1;
    s.jacobian[1] = -h;
    s.hessian[1 * 4 + 1] = 2 * h * factor;
  });
}

void pin(Analytic& a, int variable, double value) {
  a.problem.lower[variable] = a.problem.upper[variable] = value;
}

TEST(InteriorPoint, QuadraticProgramInOneStep) {
  constexpr int kStages = 10;
  Analytic a(kStages + 1, 2, 0);
  add_integrator(a, kStages);
  pin(a, 0, 0);
  pin(a, 2 * kStages, 1);
  pin(a, 2 * kStages + 1, 0);
  Point point{std::vector<double>(2 * kStages + 2), {}, {}};
  const Outcome out = a.solve(point);
  EXPECT_EQ(out.status, Status::solved) << out.message;
  EXPECT_EQ(out.iterations, 1);
  EXPECT_NEAR(out.objective, 1.0, 1e-9);  // refinement stops at 1e-10
  for (int k = 0; k < kStages; ++k) {
    EXPECT_NEAR(point.x[2 * k + 1], 1.0, 1e-9);
    EXPECT_NEAR(point.multipliers[k], 2.0, 1e-9);
  }
}

TEST(InteriorPoint, ActiveBoundsAndTheirMultipliers) {
  // The first half may not move faster than 0.5: u = 0.5 there, 1.5 afterwards.
  constexpr int kStages = 10;
  Analytic a(kStages + 1, 2, 0);
  add_integrator(a, kStages);
  pin(a, 0, 0);
  pin(a, 2 * kStages, 1);
  pin(a, 2 * kStages + 1, 0);
  for (int k = 0; k < kStages / 2; ++k) a.problem.upper[2 * k + 1] = 0.5;
  Point point{std::vector<double>(2 * kStages + 2), {}, {}};
  const Outcome out = a.solve(point, {.tolerance = 1e-10});
  EXPECT_EQ(out.status, Status::solved) << out.message;
  EXPECT_NEAR(out.objective, 1.25, 1e-8);
  // Stationarity: 2 h u - h y + b = 0 with y = 2 u of the free half.
  for (int k = 0; k < kStages / 2; ++k) {
    EXPECT_NEAR(point.x[2 * k + 1], 0.5, 1e-8);
    EXPECT_NEAR(point.bound_multipliers[2 * k + 1], 0.1 * (3.0 - 1.0), 1e-8);
  }
}

TEST(InteriorPoint, GlobalsAreTheBorder) {
  // min sum (w_k - p)^2 + (p - 3)^2 with w_0 pinned to 0 and w_k - w_{k+1} free: all w equal p but
  // the first: p^2 + (p - 3)^2 over p: 1.5, cost 4.5.
  Analytic a(5, 1, 1);
  a.add(a.problem.stages, 2, 4, {}, {}, [](int, Sample& s, double factor, const double*) {
    const double d = s.v[0] - s.v[2];
    s.cost = d * d;
    s.gradient[0] = 2 * d;
    s.gradient[2] = -2 * d;
    s.hessian[0] = s.hessian[8] = 2 * factor;
    s.hessian[6] = -2 * factor;
  });
  a.add(a.problem.last, 1, 1, {0}, {0}, [](int, Sample& s, double, const double*) {
    s.c[0] = s.v[0] - s.v[1];
    s.jacobian[0] = 1;
    s.jacobian[1] = -1;
  });
  a.add(a.problem.global, 0, 1, {-kInf}, {kInf}, [](int, Sample& s, double factor, const double*) {
    const double d = s.v[0] - 3;
    s.cost = d * d;
    s.gradient[0] = 2 * d;
    s.hessian[0] = 2 * factor;
    s.c[0] = s.v[0];  // a row without bounds is none
    s.jacobian[0] = 1;
  });
  pin(a, 0, 0);
  Point point{std::vector<double>(6, 7.0), {}, {}};
  const Outcome out = a.solve(point);
  EXPECT_EQ(out.status, Status::solved) << out.message;
  EXPECT_NEAR(out.objective, 4.5, 1e-10);
  EXPECT_NEAR(point.x[5], 1.5, 1e-10);
  EXPECT_NEAR(point.x[4], 1.5, 1e-10);
}

// Hock and Schittkowski 71 as one node: x0 x3 (x0 + x1 + x2) + x2, product >= 25, |x|^2 = 40.
void add_hs71(Analytic& a) {
  a.add(a.problem.last, 1, 1, {25, 40}, {kInf, 40}, [](int, Sample& s, double f, const double* l) {
    const double* x = s.v;
    s.cost = x[0] * x[3] * (x[0] + x[1] + x[2]) + x[2];
    s.gradient = {x[3] * (2 * x[0] + x[1] + x[2]), x[0] * x[3], x[0] * x[3] + 1,
                  x[0] * (x[0] + x[1] + x[2])};
    s.c = {x[0] * x[1] * x[2] * x[3], x[0] * x[0] + x[1] * x[1] + x[2] * x[2] + x[3] * x[3]};
    for (int i = 0; i < 4; ++i) {
      s.jacobian[4 + i] = 2 * x[i];
      s.jacobian[i] = 1;
      for (int j = 0; j < 4; ++j) {
        if (j != i) s.jacobian[i] *= x[j];
      }
    }
    const double h[4][4] = {{2 * x[3], 0, 0, 0},
                            {x[3], 0, 0, 0},
                            {x[3], 0, 0, 0},
                            {2 * x[0] + x[1] + x[2], x[0], x[0], 0}};
    for (int r = 0; r < 4; ++r) {
      for (int c = 0; c <= r; ++c) {
        double product = r == c ? 0 : 1;
        for (int j = 0; j < 4; ++j) {
          if (j != r && j != c) product *= x[j];
        }
        s.hessian[4 * r + c] = f * h[r][c] + l[0] * product + (r == c ? 2 * l[1] : 0);
      }
    }
  });
  a.problem.lower.assign(4, 1);
  a.problem.upper.assign(4, 5);
}

TEST(InteriorPoint, HockSchittkowski71) {
  Analytic a(1, 4, 0);
  add_hs71(a);
  Point point{{1, 5, 5, 1}, {}, {}};
  const Outcome out = a.solve(point, {.tolerance = 1e-10});
  EXPECT_EQ(out.status, Status::solved) << out.message;
  EXPECT_NEAR(out.objective, 17.0140172891520, 1e-8);
  EXPECT_NEAR(point.x[1], 4.7429996, 1e-6);
  EXPECT_NEAR(point.multipliers[0], -0.55229366, 1e-6);
  EXPECT_NEAR(point.bound_multipliers[0], -1.08787121, 1e-6);
}

TEST(InteriorPoint, WarmStartNeedsFewerIterations) {
  Analytic a(1, 4, 0);
  add_hs71(a);
  Point point{{1, 5, 5, 1}, {}, {}};
  const Outcome cold = a.solve(point);
  const Outcome warm = a.solve(point, {.barrier = 1e-8, .warm_start = true});
  EXPECT_EQ(warm.status, Status::solved) << warm.message;
  EXPECT_NEAR(warm.objective, cold.objective, 1e-7);
  EXPECT_LE(warm.iterations, 3);
  EXPECT_GT(cold.iterations, 5);
}

TEST(InteriorPoint, SameBitsForEveryThreadCountAndEverySolve) {
  Point one{{1, 5, 5, 1}, {}, {}}, two = one;
  Analytic a(1, 4, 0), b(1, 4, 0);
  add_hs71(a);
  add_hs71(b);
  a.solve(one);
  b.solve(two, {.threads = 2});
  EXPECT_EQ(one.x, two.x);
  EXPECT_EQ(one.multipliers, two.multipliers);
}

// Nonconvex in the whole space and in every block, convex on the constraints: min -x^2 + 2 y^2
// with x = y, whose indefinite H would stop a factorization that meets H alone.
TEST(InteriorPoint, IndefiniteHessianThatTheConstraintsMakeConvex) {
  Analytic a(1, 2, 0);
  a.add(a.problem.last, 1, 1, {1}, {1}, [](int, Sample& s, double f, const double*) {
    s.cost = -s.v[0] * s.v[0] + 2 * s.v[1] * s.v[1];
    s.gradient = {-2 * s.v[0], 4 * s.v[1]};
    s.c[0] = s.v[0] + s.v[1];
    s.jacobian = {1, 1};
    s.hessian[0] = -2 * f;
    s.hessian[3] = 4 * f;
  });
  Point point{{0, 0}, {}, {}};
  const Outcome out = a.solve(point);
  EXPECT_EQ(out.status, Status::solved) << out.message;
  EXPECT_EQ(out.iterations, 1);
  EXPECT_EQ(out.history.back().regularization, 0.0);
  EXPECT_NEAR(point.x[0], 2.0, 1e-10);
  EXPECT_NEAR(point.x[1], -1.0, 1e-10);
}

// cos x from its maximum's neighbourhood: the Hessian is negative, regularization must turn it.
TEST(InteriorPoint, NegativeCurvatureIsRegularized) {
  Analytic a(1, 1, 0);
  a.add(a.problem.last, 1, 1, {}, {}, [](int, Sample& s, double f, const double*) {
    s.cost = std::cos(s.v[0]);
    s.gradient = {-std::sin(s.v[0])};
    s.hessian = {-f * std::cos(s.v[0])};
  });
  Point point{{0.1}, {}, {}};
  const Outcome out = a.solve(point);
  EXPECT_EQ(out.status, Status::solved) << out.message;
  EXPECT_NEAR(out.objective, -1.0, 1e-12);
  EXPECT_GT(out.history[1].regularization, 0.0);
}

// Linearly dependent rows: multipliers are not unique, the solution is.
TEST(InteriorPoint, DependentConstraints) {
  Analytic a(1, 2, 0);
  a.add(a.problem.last, 1, 1, {1, 2}, {1, 2}, [](int, Sample& s, double f, const double*) {
    s.cost = s.v[0] * s.v[0] + s.v[1] * s.v[1];
    s.gradient = {2 * s.v[0], 2 * s.v[1]};
    s.c = {s.v[0] + s.v[1], 2 * s.v[0] + 2 * s.v[1]};
    s.jacobian = {1, 1, 2, 2};
    s.hessian[0] = s.hessian[3] = 2 * f;
  });
  Point point{{3, -1}, {}, {}};
  const Outcome out = a.solve(point);
  EXPECT_EQ(out.status, Status::solved) << out.message;
  EXPECT_NEAR(point.x[0], 0.5, 1e-8);
  EXPECT_NEAR(point.multipliers[0] + 2 * point.multipliers[1], -1.0, 1e-7);
}

// The unit circle and x + y = 3 do not meet: closest in the least-squares sense on the diagonal.
TEST(InteriorPoint, InfeasibleEndsWithTheReason) {
  Analytic a(1, 2, 0);
  a.add(a.problem.last, 1, 1, {1, 3}, {1, 3}, [](int, Sample& s, double, const double* l) {
    s.c = {s.v[0] * s.v[0] + s.v[1] * s.v[1], s.v[0] + s.v[1]};
    s.jacobian = {2 * s.v[0], 2 * s.v[1], 1, 1};
    s.hessian[0] = s.hessian[3] = 2 * l[0];
  });
  Point point{{2, -1}, {}, {}};
  const Outcome out = a.solve(point);
  EXPECT_EQ(out.status, Status::infeasible) << out.message;
  EXPECT_NE(out.message.find("violation"), std::string::npos);
  EXPECT_NEAR(point.x[0], point.x[1], 1e-5);
  EXPECT_GT(out.violation[0], 0.1);
  EXPECT_LT(out.violation[1], -0.1);
}

// Waechter and Biegler's counterexample: line searches that never leave the linearization crash
// into the bounds of the slacks; the filter method with restoration must not.
TEST(InteriorPoint, WaechterBieglerCounterexample) {
  Analytic a(1, 3, 0);
  a.add(a.problem.last, 1, 1, {0, 0}, {0, 0}, [](int, Sample& s, double, const double* l) {
    s.cost = s.v[0];
    s.gradient = {1, 0, 0};
    s.c = {s.v[0] * s.v[0] - s.v[1] - 1, s.v[0] - s.v[2] - 0.5};
    s.jacobian = {2 * s.v[0], -1, 0, 1, 0, -1};
    s.hessian[0] = 2 * l[0];
  });
  a.problem.lower = {-kInf, 0, 0};
  Point point{{-2, 3, 1}, {}, {}};
  const Outcome out = a.solve(point);
  EXPECT_EQ(out.status, Status::solved) << out.message;
  EXPECT_NEAR(out.objective, 1.0, 1e-7);
}

TEST(InteriorPoint, NotFiniteAtTheStart) {
  Analytic a(1, 1, 0);
  a.add(a.problem.last, 1, 1, {}, {}, [](int, Sample& s, double, const double*) {
    s.cost = std::log(s.v[0]);
    s.gradient = {1 / s.v[0]};
  });
  Point point{{-1}, {}, {}};
  EXPECT_EQ(a.solve(point).status, Status::numerical_failure);
}

// log x - x has an edge at 0 that steps overshoot: trial points that are not finite are no failure.
TEST(InteriorPoint, NotFiniteOnTheWayIsSteppedBack) {
  Analytic a(1, 1, 0);
  a.add(a.problem.last, 1, 1, {}, {}, [](int, Sample& s, double f, const double*) {
    s.cost = s.v[0] - std::log(s.v[0]);
    s.gradient = {1 - 1 / s.v[0]};
    s.hessian = {f / (s.v[0] * s.v[0])};
  });
  Point point{{2.5}, {}, {}};
  const Outcome out = a.solve(point);
  EXPECT_EQ(out.status, Status::solved) << out.message;
  EXPECT_NEAR(point.x[0], 1.0, 1e-8);
  EXPECT_GT(out.history[1].trials, 1);
}

TEST(InteriorPoint, ObserverStopsAndIterationLimitHolds) {
  Analytic a(1, 4, 0);
  add_hs71(a);
  Point point{{1, 5, 5, 1}, {}, {}};
  const Outcome stopped =
      a.solve(point, {}, [](const Record& r, const double*) { return r.iteration < 2; });
  EXPECT_EQ(stopped.status, Status::interrupted);
  EXPECT_EQ(stopped.iterations, 2);
  point.x = {1, 5, 5, 1};
  const Outcome limited = a.solve(point, {.max_iterations = 3});
  EXPECT_EQ(limited.status, Status::max_iterations);
  EXPECT_EQ(limited.history.size(), 4u);
}

TEST(InteriorPoint, RefusesInconsistentProblems) {
  Analytic a(1, 4, 0);
  add_hs71(a);
  Point point{{1, 5, 5}, {}, {}};
  EXPECT_THROW(a.solve(point), ArgumentError);
  point.x.push_back(1);
  EXPECT_THROW(a.solve(point, {.tolerance = 0.0}), ArgumentError);
  a.problem.lower[2] = 6;
  EXPECT_THROW(a.solve(point), ArgumentError);
}

}  // namespace
}  // namespace trajopt::interior_point
