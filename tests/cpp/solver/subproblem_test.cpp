// The pieces of a trust-region step: least squares in a ball, a quadratic in a disc.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "problem/fixtures.h"
#include "trajopt/linalg/conjugate_gradient.h"
#include "trajopt/solver/disc.h"

namespace trajopt {
namespace {

struct Wide {  // 5 x 9
  static constexpr int kRows = 5, kColumns = 9;
  std::vector<double> a = test::Random(1).vector(kRows * kColumns);
  std::vector<double> c = test::Random(2).vector(kRows);

  void multiply(const std::vector<double>& x, std::vector<double>& y) const {
    y.assign(kRows, 0.0);
    for (int i = 0; i < kRows; ++i)
      for (int j = 0; j < kColumns; ++j) y[i] += a[i * kColumns + j] * x[j];
  }
  void transposed(const std::vector<double>& y, std::vector<double>& x) const {
    x.assign(kColumns, 0.0);
    for (int i = 0; i < kRows; ++i)
      for (int j = 0; j < kColumns; ++j) x[j] += a[i * kColumns + j] * y[i];
  }
  linalg::LeastSquares solve(double radius, int steps, std::vector<double>& x) const {
    x.assign(kColumns, 1.0);
    return linalg::least_squares_in_ball([this](const auto& in, auto& out) { multiply(in, out); },
                                         [this](const auto& in, auto& out) { transposed(in, out); },
                                         c, radius, steps, 1e-14, x);
  }
};

TEST(LeastSquaresInBall, SolvesWhenThereIsRoom) {
  const Wide problem;
  std::vector<double> x, image;
  const linalg::LeastSquares result = problem.solve(1e6, 50, x);
  EXPECT_FALSE(result.at_boundary);
  EXPECT_LE(result.residual, 1e-12);
  problem.multiply(x, image);
  for (int i = 0; i < Wide::kRows; ++i) EXPECT_NEAR(image[i], -problem.c[i], 1e-12);
}

TEST(LeastSquaresInBall, StopsAtTheBoundary) {
  const Wide problem;
  std::vector<double> whole, x, image;
  problem.solve(1e6, 50, whole);
  const double length = std::sqrt(linalg::dot(whole, whole));
  double before = std::sqrt(linalg::dot(problem.c, problem.c));
  for (const double share : {0.1, 0.3, 0.6, 0.9}) {
    const linalg::LeastSquares result = problem.solve(share * length, 50, x);
    EXPECT_TRUE(result.at_boundary);
    EXPECT_NEAR(std::sqrt(linalg::dot(x, x)), share * length, 1e-12);
    EXPECT_LT(result.residual, before);  // more room, smaller residual
    before = result.residual;
    problem.multiply(x, image);
    for (int i = 0; i < Wide::kRows; ++i) image[i] += problem.c[i];
    EXPECT_NEAR(result.residual, std::sqrt(linalg::dot(image, image)), 1e-12);
  }
}

TEST(LeastSquaresInBall, NothingToDo) {
  Wide problem;
  problem.c.assign(Wide::kRows, 0.0);
  std::vector<double> x;
  EXPECT_EQ(problem.solve(1.0, 50, x).iterations, 0);
  for (double value : x) EXPECT_EQ(value, 0.0);
}

TEST(Disc, NoPointOfTheDiscIsBetter) {
  test::Random random(3);
  for (int i = 0; i < 500; ++i) {
    const double a = random(), b = random(), c = random(i % 5 == 0 ? 0.0 : 1.0);
    const double b00 = a * a + c * c, b01 = a * b, b11 = b * b + c * c;  // singular when c = 0
    const double g0 = random(), g1 = random(i % 7 == 0 ? 0.0 : 1.0);
    const double radius = std::exp(random(2.0));
    const auto value = [&](double x, double y) {
      return g0 * x + g1 * y + 0.5 * (b00 * x * x + 2 * b01 * x * y + b11 * y * y);
    };
    const auto y = minimize_in_disc(b00, b01, b11, g0, g1, radius);
    ASSERT_LE(std::hypot(y[0], y[1]), radius * (1 + 1e-9));
    const double best = value(y[0], y[1]);
    for (int k = 0; k < 200; ++k) {
      const double angle = 2 * std::numbers::pi * k / 200, r = radius * (k % 5 + 1) / 5;
      ASSERT_GE(value(r * std::cos(angle), r * std::sin(angle)), best - 1e-9 * (1 - best));
    }
  }
}

TEST(Disc, ZeroSlopeStays) {
  const auto y = minimize_in_disc(0, 0, 0, 0, 0, 1);
  EXPECT_EQ(y[0], 0.0);
  EXPECT_EQ(y[1], 0.0);
}

}  // namespace
}  // namespace trajopt
