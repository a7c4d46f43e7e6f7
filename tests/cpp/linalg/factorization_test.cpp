#include "trajopt/linalg/factorization.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <tuple>

#include "linalg/random_matrix.h"
#include "trajopt/base/error.h"

namespace trajopt::linalg {
namespace {

using test::dense;
using test::dense_solve;
using test::fill_random;
using test::mixed_signs;
using test::random_vector;
using test::relative_error;

constexpr Ordering kOrderings[] = {Ordering::sequential, Ordering::cyclic, Ordering::chunked};

class RandomSystem : public testing::TestWithParam<std::tuple<int, int>> {
 protected:
  RandomSystem() : a(blocks(), size()), signs(mixed_signs(a.rows(), size())) {}
  static int blocks() { return std::get<0>(GetParam()); }
  static int size() { return std::get<1>(GetParam()); }
  SymmetricBlockTridiagonal a;
  std::vector<signed char> signs;
};

TEST_P(RandomSystem, SolvesLikeADenseSolver) {
  for (bool definite : {true, false}) {
    const signed char* s = definite ? nullptr : signs.data();
    fill_random(a, s, 1);
    const std::vector<double> rhs = random_vector(a.rows(), 2);
    const bool small = a.rows() <= 400;
    const std::vector<double> expected = small ? dense_solve(dense(a), rhs) : rhs;
    for (Ordering ordering : kOrderings) {
      for (int chunks : {2, 3, 5}) {
        Factorization f(blocks(), size(), ordering, chunks);
        f.factor(a, s);
        std::vector<double> x = rhs;
        f.solve(x.data());
        const double error = small ? relative_error(x, expected) : 0.0;
        EXPECT_LT(error, 1e-9) << ordering_name(ordering);
        std::vector<double> back(rhs.size());
        a.matmul(x.data(), back.data(), 1);
        EXPECT_LT(relative_error(back, rhs), 1e-9) << ordering_name(ordering);
      }
    }
  }
}

TEST_P(RandomSystem, SameBitsForAllThreadsAndInstructionSets) {
  fill_random(a, signs.data(), 3);
  const std::vector<double> rhs = random_vector(a.rows() * 3, 4);
  const bool slow_portable = a.rows() * size() > 20000;
  for (Ordering ordering : kOrderings) {
    std::vector<double> expected;
    for (Isa isa : {Isa::avx512, Isa::avx2, Isa::portable}) {
      if (isa == Isa::portable && slow_portable) continue;
      for (int threads : {1, 2}) {
        Factorization f(blocks(), size(), ordering, 3, 1, isa);
        f.factor(a, signs.data(), 1e-3, threads);
        std::vector<double> x = rhs;
        f.solve(x.data(), 3, threads);
        if (expected.empty()) expected = x;
        EXPECT_EQ(x, expected) << ordering_name(ordering) << " " << isa_name(isa) << " " << threads;
      }
    }
  }
}

TEST_P(RandomSystem, AColumnDoesNotDependOnItsCompany) {
  fill_random(a, signs.data(), 5);
  const int m = 5;
  const std::vector<double> rhs = random_vector(a.rows() * m, 6);
  Factorization f(blocks(), size());
  f.factor(a, signs.data());
  std::vector<double> x = rhs;
  f.solve(x.data(), m);
  for (int j = 0; j < m; ++j) {
    std::vector<double> one(a.rows()), column(a.rows());
    for (long i = 0; i < a.rows(); ++i) one[i] = rhs[i * m + j], column[i] = x[i * m + j];
    f.solve(one.data());
    EXPECT_EQ(one, column);
  }
}

TEST_P(RandomSystem, SameBitsAroundTheCaches) {
  fill_random(a, signs.data(), 7);
  const std::vector<double> rhs = random_vector(a.rows(), 8);
  const bool slow_portable = a.rows() * size() > 20000;
  for (Ordering ordering : kOrderings) {
    const Schedule schedule = make_schedule(blocks(), ordering, 3);
    std::vector<double> expected;
    for (Isa isa : {Isa::avx512, Isa::avx2, Isa::portable}) {
      if (isa == Isa::portable && slow_portable) continue;
      for (Storage storage : {Storage::cached, Storage::streamed}) {
        Factors<double> factors(blocks(), size(), 1, schedule, isa, storage);
        EXPECT_TRUE(factors.factor(a, signs.data(), 1e-3, 2));
        std::vector<double> x = rhs;
        factors.solve(0, x.data(), 1, 1);
        if (expected.empty()) expected = x;
        EXPECT_EQ(x, expected) << ordering_name(ordering) << " " << isa_name(isa);
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Shapes, RandomSystem,
                         testing::Values(std::tuple{1, 1}, std::tuple{1, 7}, std::tuple{2, 1},
                                         std::tuple{2, 5}, std::tuple{3, 4}, std::tuple{5, 3},
                                         std::tuple{7, 9}, std::tuple{16, 8}, std::tuple{33, 12},
                                         std::tuple{100, 2}, std::tuple{9, 40}, std::tuple{40, 48},
                                         std::tuple{11, 82}, std::tuple{3, 130},
                                         std::tuple{5, 256}));

// The system of an equality constrained problem: H + delta, J, and -epsilon on the multipliers.
void fill_kkt(SymmetricBlockTridiagonal& a, std::vector<signed char>& signs, int multipliers,
              unsigned seed) {
  const int size = a.size(), variables = size - multipliers;
  signs.assign(a.rows(), 1);
  const std::vector<double> values =
      random_vector(2 * static_cast<std::size_t>(a.blocks()) * size * size, seed);
  const double* next = values.data();
  a.set_zero();
  for (int b = 0; b < a.blocks(); ++b) {
    double* d = a.diagonal(b);
    for (int r = 0; r < size; ++r) {
      for (int s = 0; s <= r; ++s) {
        const bool jacobian = r >= variables && s < variables;
        if (jacobian) d[r * size + s] = *next++;
        if (r < variables && r == s) d[r * size + s] = 2.0 + 0.1 * *next++;
      }
      if (r >= variables) signs[static_cast<long>(b) * size + r] = -1;
    }
    // The next block's constraints reach back to this block's variables.
    for (int r = variables; b + 1 < a.blocks() && r < size; ++r) {
      for (int s = 0; s < variables; ++s) a.lower(b)[r * size + s] = *next++;
    }
  }
}

TEST(Factorization, RefinementRemovesTheRegularizationOfAKktSystem) {
  SymmetricBlockTridiagonal a(14, 12);
  std::vector<signed char> signs;
  fill_kkt(a, signs, 4, 7);
  const std::vector<double> rhs = random_vector(a.rows(), 8);
  const std::vector<double> expected = dense_solve(dense(a), rhs);
  for (Ordering ordering : kOrderings) {
    Factorization f(14, 12, ordering, 3);
    f.factor(a, signs.data(), 1e-5);
    std::vector<double> x = rhs;
    f.solve(x.data());
    EXPECT_GT(relative_error(x, expected), 1e-9);
    const Refinement result = f.refine(a, rhs.data(), x.data(), 1, 10, 1e-14);
    EXPECT_GE(result.steps, 1);
    EXPECT_LT(result.residual, 1e-13);
    EXPECT_LT(relative_error(x, expected), 1e-9) << ordering_name(ordering);
  }
}

TEST(Factorization, RefinementTakesBackAStepThatMakesItWorse) {
  SymmetricBlockTridiagonal a(6, 5), other(6, 5);
  fill_random(a, nullptr, 1);
  fill_random(other, nullptr, 2);
  for (int i = 0; i < 6; ++i) {
    for (int r = 0; r < 5; ++r) other.diagonal(i)[r * 6] *= 50.0;
  }
  Factorization f(6, 5);
  f.factor(a);
  const std::vector<double> rhs = random_vector(30, 3);
  std::vector<double> x(30, 0.0);
  const Refinement result = f.refine(other, rhs.data(), x.data(), 1, 5, 1e-12);
  EXPECT_EQ(result.steps, 0);
  EXPECT_EQ(result.residual, 1.0);
  EXPECT_EQ(x, std::vector<double>(30, 0.0));
}

TEST(Factorization, BatchGivesTheBitsOfItsItems) {
  const int batch = 5, blocks = 6, size = 13, m = 2;
  SymmetricBlockTridiagonal many(blocks, size, batch), one(blocks, size);
  const auto signs_of_one = mixed_signs(one.rows(), size);
  fill_random(many, signs_of_one.data(), 9);
  std::vector<signed char> signs;
  for (int item = 0; item < batch; ++item) {
    signs.insert(signs.end(), signs_of_one.begin(), signs_of_one.end());
  }
  const std::vector<double> rhs = random_vector(many.rows() * m * batch, 10);
  for (Ordering ordering : kOrderings) {
    for (int threads : {1, 2}) {
      Factorization f(blocks, size, ordering, 3, batch);
      f.factor(many, signs.data(), 0.0, threads);
      std::vector<double> x = rhs;
      f.solve(x.data(), m, threads);
      for (int item = 0; item < batch; ++item) {
        std::copy_n(many.diagonal(0, item), blocks * size * size, one.diagonal(0));
        std::copy_n(many.lower(0, item), (blocks - 1) * size * size, one.lower(0));
        Factorization g(blocks, size, ordering, 3);
        g.factor(one, signs_of_one.data());
        const auto begin = rhs.begin() + item * one.rows() * m;
        std::vector<double> y(begin, begin + one.rows() * m);
        g.solve(y.data(), m);
        EXPECT_TRUE(std::equal(y.begin(), y.end(), x.begin() + item * one.rows() * m));
      }
    }
  }
}

TEST(Factorization, EmptyBatch) {
  SymmetricBlockTridiagonal a(4, 3, 0);
  Factorization f(4, 3, Ordering::automatic, 2, 0);
  f.factor(a);
  f.solve(nullptr, 2);
  EXPECT_TRUE(f.factored());
}

// Failures ---------------------------------------------------------------------------------------

struct Expected {
  int block, pivot;
};

void expect_failure(const SymmetricBlockTridiagonal& a, const signed char* signs, Expected expected,
                    const char* words) {
  for (Ordering ordering : kOrderings) {
    for (int threads : {1, 2}) {
      Factorization f(a.blocks(), a.size(), ordering, 3);
      try {
        f.factor(a, signs, 0.0, threads);
        ADD_FAILURE() << "factored with " << ordering_name(ordering);
      } catch (const FactorizationError& error) {
        EXPECT_EQ(error.block, expected.block) << ordering_name(ordering) << ": " << error.what();
        EXPECT_EQ(error.pivot, expected.pivot) << ordering_name(ordering) << ": " << error.what();
        EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
      }
      std::vector<double> x(a.rows(), 1.0);
      EXPECT_THROW(f.solve(x.data()), ArgumentError);
    }
  }
}

// A block that is coupled to nothing, so that every ordering meets the same pivot.
void isolate(SymmetricBlockTridiagonal& a, int block) {
  const int entries = a.size() * a.size();
  if (block > 0) std::fill_n(a.lower(block - 1), entries, 0.0);
  if (block + 1 < a.blocks()) std::fill_n(a.lower(block), entries, 0.0);
}

TEST(FactorizationFailure, NamesZeroPivot) {
  SymmetricBlockTridiagonal a(9, 11);
  fill_random(a, nullptr, 11);
  isolate(a, 4);
  for (int s = 0; s <= 10; ++s) a.diagonal(4)[10 * 11 + s] = 0.0;
  expect_failure(a, nullptr, {4, 10}, "zero");
}

TEST(FactorizationFailure, NamesPivotOfWrongSign) {
  SymmetricBlockTridiagonal a(9, 11);
  fill_random(a, nullptr, 12);
  isolate(a, 7);
  a.diagonal(7)[3 * 11 + 3] = -1e3;
  expect_failure(a, nullptr, {7, 3}, "wrong sign");
}

TEST(FactorizationFailure, WrongInertia) {
  SymmetricBlockTridiagonal a(9, 11);
  const auto signs = mixed_signs(a.rows(), 11);
  fill_random(a, signs.data(), 13);
  isolate(a, 2);
  a.diagonal(2)[8 * 11 + 8] = 1e3;  // a multiplier row
  expect_failure(a, signs.data(), {2, 8}, "expected a negative one");
}

TEST(FactorizationFailure, SingularInTheSum) {
  // Two unknowns that only ever occur as their difference.
  SymmetricBlockTridiagonal a(1, 2);
  double* d = a.diagonal(0);
  d[0] = d[3] = 1.0 / 3.0;
  d[2] = -1.0 / 3.0;
  expect_failure(a, nullptr, {0, 0}, "zero");
}

TEST(FactorizationFailure, NotFiniteAnywhere) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double inf = std::numeric_limits<double>::infinity();
  for (int size : {1, 3, 12}) {
    for (double bad : {nan, inf, -inf}) {
      for (int where = 0; where < 5 * size * size; ++where) {
        SymmetricBlockTridiagonal a(3, size);
        fill_random(a, nullptr, 14);
        const int block = where / (size * size), at = where % (size * size);
        if (block < 3 && at % size > at / size) continue;  // upper triangle
        (block < 3 ? a.diagonal(block) : a.lower(block - 3))[at] = bad;
        for (Ordering ordering : kOrderings) {
          Factorization f(3, size, ordering);
          EXPECT_THROW(f.factor(a), FactorizationError) << size << " " << bad << " " << where;
        }
      }
    }
  }
}

TEST(FactorizationFailure, BatchNamesTheItem) {
  SymmetricBlockTridiagonal a(3, 4, 6);
  fill_random(a, nullptr, 15);
  a.diagonal(2, 5)[15] = -1.0;
  a.diagonal(1, 3)[5] = std::nan("");
  Factorization f(3, 4, Ordering::automatic, 2, 6);
  try {
    f.factor(a, nullptr, 0.0, 2);
    ADD_FAILURE();
  } catch (const FactorizationError& error) {
    EXPECT_NE(std::string(error.what()).find("of problem 3"), std::string::npos) << error.what();
  }
}

TEST(FactorizationFailure, Arguments) {
  EXPECT_THROW(SymmetricBlockTridiagonal(0, 3), ArgumentError);
  EXPECT_THROW(SymmetricBlockTridiagonal(3, 0), ArgumentError);
  EXPECT_THROW(Factorization(3, -1), ArgumentError);
  EXPECT_THROW(Factorization(3, 1, Ordering::chunked, 0), ArgumentError);
  SymmetricBlockTridiagonal a(3, 2);
  Factorization f(4, 2);
  EXPECT_THROW(f.factor(a), ArgumentError);
}

}  // namespace
}  // namespace trajopt::linalg
