#include "trajopt/linalg/bordered.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <tuple>

#include "linalg/random_matrix.h"
#include "trajopt/base/error.h"

namespace trajopt::linalg {
namespace {

using test::random_vector;

struct System {
  SymmetricBlockTridiagonal k;
  std::vector<double> e, f;
  std::vector<signed char> signs, border_signs;
  int border;

  System(int blocks, int size, int border_size)
      : k(blocks, size),
        e(random_vector(k.rows() * border_size, 2)),
        f(border_size * border_size, 0.0),
        signs(test::mixed_signs(k.rows(), size)),
        border_signs(test::mixed_signs(border_size, border_size)),
        border(border_size) {
    test::fill_random(k, signs.data(), 1);
    for (double& value : e) value *= 0.1;
    for (int i = 0; i < border; ++i) f[i * border + i] = border_signs[i] * (5.0 + k.rows());
  }

  std::vector<double> dense() const {
    const long rows = k.rows(), n = rows + border;
    const std::vector<double> inner = test::dense(k);
    std::vector<double> full(n * n);
    for (long i = 0; i < rows; ++i) {
      std::copy_n(inner.data() + i * rows, rows, full.data() + i * n);
      for (int j = 0; j < border; ++j) {
        full[i * n + rows + j] = full[(rows + j) * n + i] = e[i * border + j];
      }
    }
    for (int i = 0; i < border; ++i) {
      for (int j = 0; j <= i; ++j) {
        full[(rows + i) * n + rows + j] = full[(rows + j) * n + rows + i] = f[i * border + j];
      }
    }
    return full;
  }
};

class BorderedTest : public testing::TestWithParam<std::tuple<int, int, int>> {};

TEST_P(BorderedTest, SolvesLikeADenseSolver) {
  const auto [blocks, size, border] = GetParam();
  const System system(blocks, size, border);
  const long rows = system.k.rows(), n = rows + border;
  const std::vector<double> rhs = random_vector(n, 3);
  const std::vector<double> expected = test::dense_solve(system.dense(), rhs);
  for (Ordering ordering : {Ordering::sequential, Ordering::cyclic, Ordering::chunked}) {
    std::vector<double> first;
    for (int threads : {1, 2}) {
      BorderedFactorization factorization(blocks, size, border, ordering, 3);
      factorization.factor(system.k, system.e.data(), system.f.data(), system.signs.data(),
                           system.border_signs.data(), 0.0, threads);
      std::vector<double> x = rhs;
      factorization.solve(x.data(), x.data() + rows, 1, threads);
      EXPECT_LT(test::relative_error(x, expected), 1e-9);
      if (first.empty()) first = x;
      EXPECT_EQ(x, first);
    }
    BorderedFactorization shifted(blocks, size, border, ordering, 3);
    shifted.factor(system.k, system.e.data(), system.f.data(), system.signs.data(),
                   system.border_signs.data(), 1e-3);
    std::vector<double> x = rhs;
    shifted.solve(x.data(), x.data() + rows);
    const Refinement result =
        shifted.refine(system.k, system.f.data(), rhs.data(), rhs.data() + rows, x.data(),
                       x.data() + rows, 10, 1e-13);
    EXPECT_LT(result.residual, 1e-12);
    EXPECT_LT(test::relative_error(x, expected), 1e-9);
  }
}

INSTANTIATE_TEST_SUITE_P(Shapes, BorderedTest,
                         testing::Values(std::tuple{1, 1, 1}, std::tuple{5, 6, 1},
                                         std::tuple{8, 9, 3}, std::tuple{10, 12, 8},
                                         std::tuple{6, 5, 17}, std::tuple{4, 40, 40}));

TEST(Bordered, ManyColumnsAreTheColumns) {
  const System system(7, 6, 4);
  const long rows = system.k.rows();
  BorderedFactorization factorization(7, 6, 4);
  factorization.factor(system.k, system.e.data(), system.f.data(), system.signs.data(),
                       system.border_signs.data());
  const int m = 3;
  std::vector<double> z = random_vector(rows * m, 4), y = random_vector(4 * m, 5);
  std::vector<double> z1(rows), y1(4);
  for (long i = 0; i < rows; ++i) z1[i] = z[i * m + 1];
  for (int i = 0; i < 4; ++i) y1[i] = y[i * m + 1];
  factorization.solve(z.data(), y.data(), m);
  factorization.solve(z1.data(), y1.data());
  for (long i = 0; i < rows; ++i) EXPECT_EQ(z1[i], z[i * m + 1]);
  for (int i = 0; i < 4; ++i) EXPECT_EQ(y1[i], y[i * m + 1]);
}

// What is known to be zero is left out, and nothing else changes.
TEST(Bordered, ReachOfABorder) {
  for (int reach : {1, 2, 3}) {
    System system(7, 6, 5);
    const long rows = system.k.rows();
    for (long i = reach * 6; i < rows - reach * 6; ++i)
      for (int j = 0; j < 5; ++j) system.e[i * 5 + j] = 0.0;
    std::vector<double> found[2];
    for (int k : {0, 1}) {
      BorderedFactorization factorization(7, 6, 5, Ordering::cyclic, 2, Isa::avx512,
                                          k == 0 ? 0 : reach);
      factorization.factor(system.k, system.e.data(), system.f.data(), system.signs.data(),
                           system.border_signs.data(), 0.3);
      const std::vector<double> rhs = random_vector(rows + 5, 4);
      std::vector<double>& x = found[k];
      x = rhs;
      factorization.solve(x.data(), x.data() + rows);
      factorization.refine(system.k, system.f.data(), rhs.data(), rhs.data() + rows, x.data(),
                           x.data() + rows, 3, 0.0);
    }
    EXPECT_EQ(found[1], found[0]);
  }
  EXPECT_THROW(BorderedFactorization(7, 6, 5, Ordering::cyclic, 2, Isa::avx512, 4), ArgumentError);
}

// A pivot of K or of the border: false, and nothing to solve with until it goes well.
TEST(Bordered, TryFactorSaysNo) {
  System system(4, 3, 2);
  BorderedFactorization factorization(4, 3, 2);
  const auto attempt = [&] {
    return factorization.try_factor(system.k, system.e.data(), system.f.data(),
                                    system.signs.data());
  };
  std::vector<double> z(12, 1.0), y(2, 1.0);
  const double good = system.f[3];
  ASSERT_TRUE(attempt());
  factorization.solve(z.data(), y.data());
  system.f[3] = -1e3;
  EXPECT_FALSE(attempt());
  EXPECT_THROW(factorization.solve(z.data(), y.data()), ArgumentError);
  system.f[3] = good;
  system.k.diagonal(2)[0] = std::nan("");
  EXPECT_FALSE(attempt());
  EXPECT_THROW(factorization.solve(z.data(), y.data()), ArgumentError);
}

TEST(Bordered, NamesAPivotOfTheBorder) {
  System system(4, 3, 2);
  system.f[3] = -1e3;
  BorderedFactorization factorization(4, 3, 2);
  try {
    factorization.factor(system.k, system.e.data(), system.f.data(), system.signs.data());
    ADD_FAILURE();
  } catch (const FactorizationError& error) {
    EXPECT_EQ(error.block, 4);
    EXPECT_EQ(error.pivot, 1);
    EXPECT_NE(std::string(error.what()).find("border"), std::string::npos);
  }
  EXPECT_THROW(BorderedFactorization(4, 3, 0), ArgumentError);
}

}  // namespace
}  // namespace trajopt::linalg
