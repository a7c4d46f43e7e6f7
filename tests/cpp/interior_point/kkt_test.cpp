// The condensed solve against the dense equations it stands for, on random staged matrices.
#include "trajopt/interior_point/kkt.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "interior_point/analytic.h"

namespace trajopt::interior_point {
namespace {

using test::Analytic;
using test::Sample;

struct Random {
  std::mt19937 engine{7};
  std::vector<double> vector(std::size_t size) {
    std::normal_distribution<double> normal;
    std::vector<double> v(size);
    for (double& x : v) x = normal(engine);
    return v;
  }
};

// Constant random Jacobians, Hessians indefinite by themselves: -0.3 on some diagonals.
void add_random(Analytic& a, Part& part, int span, int count, int rows, Random& random) {
  const int locals = span * a.problem.node_size + a.problem.globals;
  auto j = random.vector(count * rows * locals), h = random.vector(count * locals * locals);
  a.add(part, span, count, std::vector<double>(rows, 0.0), std::vector<double>(rows, 0.0),
        [=](int k, Sample& s, double factor, const double*) {
          s.jacobian.assign(j.begin() + k * rows * locals, j.begin() + (k + 1) * rows * locals);
          for (int r = 0; r < locals; ++r) {
            for (int c = 0; c < r; ++c) {
              s.hessian[r * locals + c] = 0.05 * factor * h[(k * locals + r) * locals + c];
            }
            s.hessian[r * (locals + 1)] = factor * (r % 3 == 0 ? -0.3 : 2.0);
          }
        });
}

void expect_solves(int nodes, int size, int globals, int stage_rows, int last_rows,
                   int global_rows) {
  Random random;
  Analytic a(nodes, size, globals);
  add_random(a, a.problem.stages, 2, nodes - 1, stage_rows, random);
  add_random(a, a.problem.last, 1, 1, last_rows, random);
  if (globals > 0) add_random(a, a.problem.global, 0, 1, global_rows, random);
  a.problem.lower[0] = a.problem.upper[0] = 1.0;
  ScaledProblem scaled(a.problem);
  const int n = scaled.variables(), m = scaled.rows();
  std::vector<double> x(n, 0.0), multipliers(m, 0.0);
  ASSERT_TRUE(scaled.derivatives(x.data(), multipliers.data()));
  Kkt kkt(scaled, linalg::Ordering::automatic, 1, 10);
  std::vector<double> diagonal(n, 0.1), e(m, 0.0), regularized(m), dx(n), dl(m);
  for (int i = 0; i < m; i += 3) e[i] = 0.5;
  for (int i = 0; i < m; ++i) regularized[i] = e[i] + 1e-8;
  ASSERT_TRUE(kkt.factor(diagonal.data(), regularized.data(), true));
  const auto b1 = random.vector(n), b2 = random.vector(m);
  ASSERT_TRUE(kkt.solve(b1.data(), b2.data(), e.data(), dx.data(), dl.data()));

  // The equations, from the products that do not know the blocks.
  std::vector<double> r1(n, 0.0), r2(m, 0.0);
  scaled.add_hessian_product(dx.data(), r1.data());
  scaled.add_jacobian_transposed_product(dl.data(), r1.data());
  scaled.add_jacobian_product(dx.data(), r2.data());
  EXPECT_EQ(dx[0], 0.0);  // pinned
  for (int i = 1; i < n; ++i) EXPECT_NEAR(r1[i] + 0.1 * dx[i], b1[i], 1e-9) << i;
  for (int i = 0; i < m; ++i) EXPECT_NEAR(r2[i] - e[i] * dl[i], b2[i], 1e-9) << i;
}

TEST(Kkt, SolvesChains) { expect_solves(12, 5, 0, 3, 1, 0); }
TEST(Kkt, SolvesWithGlobals) { expect_solves(12, 5, 3, 3, 2, 1); }
TEST(Kkt, SolvesOneNode) { expect_solves(1, 6, 0, 0, 3, 0); }
TEST(Kkt, SolvesTwoNodesAndWideBorder) { expect_solves(2, 4, 9, 2, 0, 4); }

TEST(Kkt, WrongInertiaIsNoticed) {
  Analytic a(1, 2, 0);
  a.add(a.problem.last, 1, 1, {0}, {0}, [](int, Sample& s, double f, const double*) {
    s.jacobian = {1, 0};
    s.hessian = {5 * f, 0, 0, -f};  // negative where the constraint does not see it
  });
  ScaledProblem scaled(a.problem);
  const std::vector<double> x(2, 0.0), multipliers(1, 0.0), none(2, 0.0), two(2, 2.0);
  ASSERT_TRUE(scaled.derivatives(x.data(), multipliers.data()));
  Kkt kkt(scaled, linalg::Ordering::automatic, 1, 10);
  const double regularized = 1e-8;
  EXPECT_FALSE(kkt.factor(none.data(), &regularized, true));
  EXPECT_TRUE(kkt.factor(two.data(), &regularized, true));
}

// Rows met by stiff unknowns alone: J K^-1 J^T is 1e-5 down to 1e-10, where epsilon is 1e-8, and
// the rows ask for far less than the gradient. One correction after the other would leave half of
// the last row's residual.
TEST(Kkt, RowsOfStiffUnknowns) {
  constexpr int kSize = 6;
  Analytic a(1, kSize, 0);
  a.add(a.problem.last, 1, 1, std::vector<double>(kSize, 0.0), std::vector<double>(kSize, 0.0),
        [](int, Sample& s, double f, const double*) {
          for (int i = 0; i < kSize; ++i) {
            s.jacobian[i * (kSize + 1)] = 1.0;
            s.hessian[i * (kSize + 1)] = f * std::pow(10.0, 5 + i);
          }
        });
  ScaledProblem scaled(a.problem);
  const std::vector<double> none(kSize, 0.0), regularized(kSize, 1e-8);
  ASSERT_TRUE(scaled.derivatives(none.data(), none.data()));
  Kkt kkt(scaled, linalg::Ordering::automatic, 1, 10);
  ASSERT_TRUE(kkt.factor(none.data(), regularized.data(), true));
  const std::vector<double> b1(kSize, 1e4), b2(kSize, 1e-4);
  std::vector<double> dx(kSize), dl(kSize);
  ASSERT_TRUE(kkt.solve(b1.data(), b2.data(), none.data(), dx.data(), dl.data()));
  for (int i = 0; i < kSize; ++i) EXPECT_NEAR(dx[i], 1e-4, 1e-10) << i;
}

TEST(ScaledProblem, DenseProductsAndScales) {
  Random random;
  Analytic a(3, 2, 1);
  add_random(a, a.problem.stages, 2, 2, 2, random);
  ScaledProblem scaled(a.problem);
  const int n = scaled.variables(), m = scaled.rows();
  std::vector<double> x(n, 0.0), l(m, 0.0), v = random.vector(n), u = random.vector(m);
  ASSERT_TRUE(scaled.derivatives(x.data(), l.data()));
  // u.(J v) = v.(J^T u), and the Hessian product is symmetric.
  std::vector<double> jv(m, 0.0), ju(n, 0.0), hv(n, 0.0), hx(n, 0.0);
  scaled.add_jacobian_product(v.data(), jv.data());
  scaled.add_jacobian_transposed_product(u.data(), ju.data());
  double left = 0, right = 0, symmetric = 0;
  for (int i = 0; i < m; ++i) left += u[i] * jv[i];
  for (int i = 0; i < n; ++i) right += v[i] * ju[i];
  EXPECT_NEAR(left, right, 1e-12);
  const auto w = random.vector(n);
  scaled.add_hessian_product(v.data(), hv.data());
  scaled.add_hessian_product(w.data(), hx.data());
  for (int i = 0; i < n; ++i) symmetric += w[i] * hv[i] - v[i] * hx[i];
  EXPECT_NEAR(symmetric, 0.0, 1e-12);
  scaled.choose_scales();
  for (double s : scaled.row_scale()) EXPECT_EQ(s, 1.0);  // gradients far below 100
}

}  // namespace
}  // namespace trajopt::interior_point
