#include "trajopt/base/sincos.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace trajopt {
namespace {

// Error in units of the last place of the exact result.
double ulps(double value, long double exact) {
  const double nearest = static_cast<double>(exact);
  const double ulp = std::nextafter(std::abs(nearest), HUGE_VAL) - std::abs(nearest);
  return static_cast<double>(std::abs(static_cast<long double>(value) - exact) / ulp);
}

TEST(Sincos, WithinTwoUlps) {
  std::mt19937_64 generator(1);
  for (const double range : {0.8, 10.0, 1e4}) {
    std::uniform_real_distribution<double> angle(-range, range);
    double worst = 0;
    for (int i = 0; i < 100000; ++i) {
      const double x = angle(generator);
      double s, c;
      sincos(x, s, c);
      worst = std::max({worst, ulps(s, std::sin(static_cast<long double>(x))),
                        ulps(c, std::cos(static_cast<long double>(x)))});
    }
    EXPECT_LE(worst, 2.0) << "range " << range;
  }
}

TEST(Sincos, QuadrantsAndZero) {
  const double half_pi = 1.5707963267948966;
  for (int k = -9; k <= 9; ++k) {
    for (const double nudge : {-1e-9, 0.0, 1e-9, 0.785, -0.785}) {
      const double x = k * half_pi + nudge;
      double s, c;
      sincos(x, s, c);
      EXPECT_NEAR(s, std::sin(x), 1.2e-16) << x;
      EXPECT_NEAR(c, std::cos(x), 1.2e-16) << x;
    }
  }
  double s, c;
  sincos(0.0, s, c);
  EXPECT_EQ(s, 0.0);
  EXPECT_EQ(c, 1.0);
}

TEST(Sincos, LanesHaveTheBitsOfTheScalar) {
  std::mt19937_64 generator(2);
  std::uniform_real_distribution<double> angle(-50, 50);
  for (int i = 0; i < 1000; ++i) {
    Pack<2> x(0.0), s, c;
    for (int k = 0; k < 2; ++k) x.set(k, angle(generator));
    sincos(x, s, c);
    for (int k = 0; k < 2; ++k) {
      double a, b;
      sincos(x[k], a, b);
      EXPECT_EQ(s[k], a);
      EXPECT_EQ(c[k], b);
    }
  }
}

}  // namespace
}  // namespace trajopt
