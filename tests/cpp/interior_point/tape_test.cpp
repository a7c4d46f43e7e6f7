// The interpreter against the operations' definitions, for every number of copies and threads.
#include "trajopt/interior_point/tape.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "trajopt/base/error.h"

namespace trajopt::interior_point {
namespace {

int code(Operation operation) { return static_cast<int>(operation); }

// out = operation(x, y) for copies of the inputs (x, y).
std::vector<double> run(Operation operation, const std::vector<double>& xy, int threads = 1) {
  const int copies = static_cast<int>(xy.size()) / 2;
  std::vector<double> out(copies, -77.0);
  Tape tape({{code(Operation::input), 0, 0, 0},
             {code(Operation::input), 1, 0, 1},
             {code(operation), 2, 0, 1},
             {code(Operation::output), 0, 2, 0}},
            {}, 3, {{xy.data(), 2, 2}}, {{out.data(), 1, 1}}, copies, threads);
  tape.evaluate();
  return out;
}

TEST(Tape, EveryOperation) {
  struct Case {
    Operation operation;
    std::function<double(double, double)> f;
    double ulps;
  };
  using O = Operation;
  const Case cases[] = {
      {O::assign, [](double x, double) { return x; }, 0},
      {O::add, [](double x, double y) { return x + y; }, 0},
      {O::sub, [](double x, double y) { return x - y; }, 0},
      {O::mul, [](double x, double y) { return x * y; }, 0},
      {O::div, [](double x, double y) { return x / y; }, 0},
      {O::neg, [](double x, double) { return -x; }, 0},
      {O::exp, [](double x, double) { return std::exp(x); }, 0},
      {O::log, [](double x, double) { return std::log(x); }, 0},
      {O::pow, [](double x, double y) { return std::pow(x, y); }, 0},
      {O::constpow, [](double x, double y) { return std::pow(x, y); }, 0},
      {O::sqrt, [](double x, double) { return std::sqrt(x); }, 0},
      {O::sq, [](double x, double) { return x * x; }, 0},
      {O::twice, [](double x, double) { return 2 * x; }, 0},
      {O::sin, [](double x, double) { return std::sin(x); }, 2},
      {O::cos, [](double x, double) { return std::cos(x); }, 2},
      {O::tan, [](double x, double) { return std::tan(x); }, 0},
      {O::asin, [](double x, double) { return std::asin(x); }, 0},
      {O::acos, [](double x, double) { return std::acos(x); }, 0},
      {O::atan, [](double x, double) { return std::atan(x); }, 0},
      {O::lt, [](double x, double y) { return x < y; }, 0},
      {O::le, [](double x, double y) { return x <= y; }, 0},
      {O::eq, [](double x, double y) { return x == y; }, 0},
      {O::ne, [](double x, double y) { return x != y; }, 0},
      {O::logic_not, [](double x, double) { return x == 0; }, 0},
      {O::logic_and, [](double x, double y) { return x != 0 && y != 0; }, 0},
      {O::logic_or, [](double x, double y) { return x != 0 || y != 0; }, 0},
      {O::floor, [](double x, double) { return std::floor(x); }, 0},
      {O::ceil, [](double x, double) { return std::ceil(x); }, 0},
      {O::fmod, [](double x, double y) { return std::fmod(x, y); }, 0},
      {O::fabs, [](double x, double) { return std::fabs(x); }, 0},
      {O::sign, [](double x, double) { return x < 0   ? -1.0
                                              : x > 0 ? 1.0
                                                      : x; }, 0},
      {O::copysign, [](double x, double y) { return std::copysign(x, y); }, 0},
      {O::if_else_zero, [](double x, double y) { return x != 0 ? y : 0.0; }, 0},
      {O::erf, [](double x, double) { return std::erf(x); }, 0},
      {O::fmin, [](double x, double y) { return std::fmin(x, y); }, 0},
      {O::fmax, [](double x, double y) { return std::fmax(x, y); }, 0},
      {O::inv, [](double x, double) { return 1 / x; }, 0},
      {O::sinh, [](double x, double) { return std::sinh(x); }, 0},
      {O::cosh, [](double x, double) { return std::cosh(x); }, 0},
      {O::tanh, [](double x, double) { return std::tanh(x); }, 0},
      {O::asinh, [](double x, double) { return std::asinh(x); }, 0},
      {O::acosh, [](double x, double) { return std::acosh(x); }, 0},
      {O::atanh, [](double x, double) { return std::atanh(x); }, 0},
      {O::atan2, [](double x, double y) { return std::atan2(x, y); }, 0},
  };
  // Inside and outside of the domains; 3e6 is beyond the range of the vector sine.
  const std::vector<double> xy = {0.3, 0.7,  -0.4, 2.0, 1.5,  -1.5, 0.0, 0.0, 0.0, -2.0, 3.0,
                                  3.0, -7.5, 2.5,  3e6, 1e-3, 2e5,  4.0, 0.9, 0.9, -2.0, 0.5};
  EXPECT_EQ(std::size(cases), static_cast<std::size_t>(code(Operation::constant)));
  for (const Case& c : cases) {
    const auto out = run(c.operation, xy);
    for (std::size_t k = 0; k < out.size(); ++k) {
      const double expected = c.f(xy[2 * k], xy[2 * k + 1]);
      if (std::isnan(expected)) {
        EXPECT_TRUE(std::isnan(out[k])) << code(c.operation) << " of copy " << k;
      } else if (std::isinf(expected)) {
        EXPECT_EQ(out[k], expected) << code(c.operation) << " of copy " << k;
      } else {
        EXPECT_LE(std::abs(out[k] - expected), c.ulps * 2.3e-16)
            << code(c.operation) << " of copy " << k;
      }
    }
  }
}

TEST(Tape, CopiesDependNeitherOnNeighboursNorOnThreads) {
  std::vector<double> xy;
  for (int k = 0; k < 37; ++k) {
    xy.push_back(0.37 * k - 3.0);
    xy.push_back(1.0 + 0.01 * k);
  }
  const auto all = run(Operation::sin, xy), threaded = run(Operation::sin, xy, 2);
  EXPECT_EQ(all, threaded);
  for (int k = 0; k < 37; ++k) {
    const auto one = run(Operation::sin, {xy[2 * k], xy[2 * k + 1]});
    EXPECT_EQ(one[0], all[k]) << k;
  }
}

TEST(Tape, OverlappingInputsAndConstants) {
  // y_k = 10 x_k + x_{k+1} from one array.
  const std::vector<double> x = {1, 2, 3, 4};
  std::vector<double> y(3);
  Tape tape({{code(Operation::input), 0, 0, 0},
             {code(Operation::input), 1, 1, 0},
             {code(Operation::constant), 2, 0, 0},
             {code(Operation::mul), 0, 0, 2},
             {code(Operation::add), 0, 0, 1},
             {code(Operation::output), 0, 0, 0}},
            {10.0}, 3, {{x.data(), 1, 1}, {x.data() + 1, 1, 1}}, {{y.data(), 1, 1}}, 3, 1);
  tape.evaluate();
  EXPECT_EQ(y, (std::vector<double>{12, 23, 34}));
}

TEST(Tape, RefusesWhatDoesNotExist) {
  std::vector<double> x(1), y(1);
  const auto make = [&](Instruction i) {
    Tape({i}, {1.0}, 2, {{x.data(), 1, 1}}, {{y.data(), 1, 1}}, 1, 1);
  };
  make({code(Operation::add), 0, 1, 1});
  EXPECT_THROW(make({code(Operation::add), 2, 1, 1}), ArgumentError);
  EXPECT_THROW(make({code(Operation::add), 0, -1, 1}), ArgumentError);
  EXPECT_THROW(make({code(Operation::constant), 0, 1, 0}), ArgumentError);
  EXPECT_THROW(make({code(Operation::input), 0, 1, 0}), ArgumentError);
  EXPECT_THROW(make({code(Operation::input), 0, 0, 1}), ArgumentError);
  EXPECT_THROW(make({code(Operation::output), 1, 0, 0}), ArgumentError);
  EXPECT_THROW(make({code(Operation::count), 0, 0, 0}), ArgumentError);
  EXPECT_THROW(make({-1, 0, 0, 0}), ArgumentError);
}

}  // namespace
}  // namespace trajopt::interior_point
