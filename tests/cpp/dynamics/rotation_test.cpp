#include "trajopt/model/rotation.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace trajopt {
namespace {

constexpr double kPi = 3.14159265358979323846;

class Rotations : public testing::TestWithParam<double> {
 protected:
  Vec3<double> random_vector(double angle) {
    Vec3<double> r{normal_(generator_), normal_(generator_), normal_(generator_)};
    return (angle / std::sqrt(dot(r, r))) * r;
  }
  std::mt19937_64 generator_{1};
  std::normal_distribution<double> normal_;
};

double distance(const Vec3<double>& a, const Vec3<double>& b) {
  const Vec3<double> d = a - b;
  return std::sqrt(dot(d, d));
}

TEST_P(Rotations, LogarithmUndoesExponential) {
  for (int i = 0; i < 1000; ++i) {
    const Vec3<double> r = random_vector(GetParam());
    double q[4];
    quaternion_exp(r, q);
    EXPECT_NEAR(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3], 1.0, 1e-15);
    EXPECT_LE(distance(quaternion_log(q), r), 1e-15 * (1 + GetParam()));
    const double minus[4] = {-q[0], -q[1], -q[2], -q[3]};  // the same rotation
    EXPECT_LE(distance(quaternion_log(minus), r), 1e-15 * (1 + GetParam()));
  }
}

TEST_P(Rotations, LeftJacobianIsTheDerivative) {
  for (int i = 0; i < 100; ++i) {
    const Vec3<double> r = random_vector(GetParam());
    const Mat3<double> j = left_jacobian(r);
    const double h = 1e-4;
    for (int k = 0; k < 3; ++k) {
      const auto turned = [&](double step) {
        Vec3<double> moved = r;
        moved[k] += step;
        double a[4], b[4];
        quaternion_exp(moved, a);
        quaternion_exp(r, b);
        return quaternion_difference(a, b);
      };
      const Vec3<double> near = turned(h) - turned(-h), far = turned(2 * h) - turned(-2 * h);
      const Vec3<double> numeric = (1 / (12 * h)) * (8.0 * near - far);
      EXPECT_LE(distance(numeric, j.column(k)), 1e-10);
    }
  }
}

TEST_P(Rotations, InverseOfTheLeftJacobian) {
  for (int i = 0; i < 100; ++i) {
    const Vec3<double> r = random_vector(GetParam());
    const Mat3<double> product = left_jacobian(r) * left_jacobian_inverse(r);
    for (int k = 0; k < 9; ++k) EXPECT_NEAR(product.m[k], k % 4 == 0 ? 1 : 0, 1e-12);
  }
}

// From nothing over the switch between series and closed form (0.01) to half a turn.
INSTANTIATE_TEST_SUITE_P(Angles, Rotations,
                         testing::Values(1e-300, 1e-160, 1e-12, 1e-8, 1e-4, 0.00999, 0.01001, 0.02,
                                         0.5, 2.0, 3.0, kPi - 1e-3, kPi - 1e-8));

TEST(Quaternion, NeverLeavesTheSphere) {
  double q[4] = {1, 0, 0, 0}, turn[4];
  quaternion_exp({0.3, -0.2, 0.7}, turn);
  for (int i = 0; i < 100000; ++i) quaternion_product(turn, q, q);
  EXPECT_NEAR(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3], 1.0, 1e-15);
}

}  // namespace
}  // namespace trajopt
