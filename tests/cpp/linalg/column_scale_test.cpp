// The power of two against the standard library's functions, which a device does not have.
#include "trajopt/linalg/column_scale.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>

namespace trajopt::linalg {
namespace {

double by_the_library(double most) {
  const int exponent = most > 0.0 && std::isfinite(most) ? std::ilogb(most) : 0;
  return std::ldexp(1.0, std::clamp(exponent, -1000, 1000));
}

TEST(ColumnScale, EveryExponent) {
  for (int exponent = -1074; exponent <= 1023; ++exponent) {
    const double power = std::ldexp(1.0, exponent);
    for (double value : {power, std::nextafter(power, 0.0), std::nextafter(power, INFINITY)}) {
      EXPECT_EQ(column_scale(value), by_the_library(value)) << value;
    }
  }
}

TEST(ColumnScale, WhatIsNoMagnitudeToDivideBy) {
  using Limits = std::numeric_limits<double>;
  for (double value : {0.0, -0.0, -1.0, -Limits::infinity(), Limits::infinity(),
                       Limits::quiet_NaN(), -Limits::quiet_NaN()}) {
    EXPECT_EQ(column_scale(value), 1.0) << value;
    EXPECT_EQ(by_the_library(value), 1.0) << value;
  }
  for (double value : {Limits::max(), Limits::min(), Limits::denorm_min()}) {
    EXPECT_EQ(column_scale(value), by_the_library(value)) << value;
  }
}

TEST(ColumnScale, AnyBits) {
  std::mt19937_64 generator(1);
  for (int i = 0; i < 100000; ++i) {
    const double value = std::bit_cast<double>(static_cast<std::uint64_t>(generator()));
    ASSERT_EQ(column_scale(value), by_the_library(value)) << value;
  }
}

}  // namespace
}  // namespace trajopt::linalg
