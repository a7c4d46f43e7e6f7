// float32 factors: refinement recovers float64's accuracy, and the bits depend on nothing else.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <tuple>

#include "linalg/random_matrix.h"
#include "trajopt/base/error.h"
#include "trajopt/linalg/factorization.h"

namespace trajopt::linalg {
namespace {

using test::fill_random;
using test::mixed_signs;
using test::random_vector;
using test::relative_error;

constexpr Ordering kOrderings[] = {Ordering::sequential, Ordering::cyclic, Ordering::chunked};

Factorization single(int blocks, int size, Ordering ordering, Isa isa = Isa::avx512) {
  return Factorization(blocks, size, ordering, 3, 1, isa, Precision::float32);
}

class SinglePrecision : public testing::TestWithParam<std::tuple<int, int>> {
 protected:
  SinglePrecision() : a(blocks(), size()), signs(mixed_signs(a.rows(), size())) {
    fill_random(a, signs.data(), 1);
  }
  static int blocks() { return std::get<0>(GetParam()); }
  static int size() { return std::get<1>(GetParam()); }
  SymmetricBlockTridiagonal a;
  std::vector<signed char> signs;
};

TEST_P(SinglePrecision, RefinesToTheAccuracyOfDoublePrecision) {
  const int m = 11;  // more columns than are rounded at once
  const std::vector<double> rhs = random_vector(a.rows() * m, 2);
  for (Ordering ordering : kOrderings) {
    Factorization f = single(blocks(), size(), ordering);
    EXPECT_EQ(f.precision(), Precision::float32);
    f.factor(a, signs.data());
    std::vector<double> x = rhs, back(rhs.size());
    f.solve(x.data(), m);
    a.matmul(x.data(), back.data(), m);
    EXPECT_LT(relative_error(back, rhs), 1e-4) << ordering_name(ordering);
    const Refinement result = f.refine(a, rhs.data(), x.data(), m, 10, 1e-15);
    EXPECT_LT(result.residual, 1e-14) << ordering_name(ordering);

    Factorization reference(blocks(), size(), ordering, 3);
    reference.factor(a, signs.data());
    std::vector<double> expected = rhs;
    reference.solve(expected.data(), m);
    EXPECT_LT(relative_error(x, expected), 1e-13) << ordering_name(ordering);
  }
}

TEST_P(SinglePrecision, SameBitsForAllThreadsInstructionSetsAndStorages) {
  const std::vector<double> rhs = random_vector(a.rows() * 3, 3);
  for (Ordering ordering : kOrderings) {
    std::vector<double> expected;
    for (Isa isa : {Isa::avx512, Isa::avx2, Isa::portable}) {
      for (int threads : {1, 2}) {
        Factorization f = single(blocks(), size(), ordering, isa);
        f.factor(a, signs.data(), 1e-3, threads);
        std::vector<double> x = rhs;
        f.solve(x.data(), 3, threads);
        f.refine(a, rhs.data(), x.data(), 3, 2, 0.0, threads);
        if (expected.empty()) expected = x;
        EXPECT_EQ(x, expected) << ordering_name(ordering) << " " << isa_name(isa) << " " << threads;
      }
    }
    const Schedule schedule = make_schedule(blocks(), ordering, 3);
    std::vector<float> first;
    for (Storage storage : {Storage::cached, Storage::streamed}) {
      Factors<float> factors(blocks(), size(), 1, schedule, Isa::avx512, storage);
      EXPECT_TRUE(factors.factor(a, signs.data(), 0.0, 2));
      std::vector<float> x(rhs.begin(), rhs.begin() + a.rows());
      factors.solve(0, x.data(), 1, 1);
      if (first.empty()) first = x;
      EXPECT_EQ(x, first) << ordering_name(ordering);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Shapes, SinglePrecision,
                         testing::Values(std::tuple{1, 1}, std::tuple{3, 1}, std::tuple{2, 5},
                                         std::tuple{7, 9}, std::tuple{33, 12}, std::tuple{20, 16},
                                         std::tuple{13, 17}, std::tuple{9, 40}, std::tuple{5, 82}));

TEST(SinglePrecision, RightHandSidesOutsideTheRangeOfFloat) {
  SymmetricBlockTridiagonal a(5, 4);
  fill_random(a, nullptr, 4);
  Factorization f = single(5, 4, Ordering::chunked);
  f.factor(a);
  const std::vector<double> rhs = random_vector(20, 5);
  std::vector<double> expected = rhs;
  f.solve(expected.data());
  for (double scale : {std::ldexp(1.0, 900), std::ldexp(1.0, -900)}) {
    std::vector<double> x = rhs;
    for (double& value : x) value *= scale;
    f.solve(x.data());
    for (double& value : x) value /= scale;
    EXPECT_EQ(x, expected) << scale;
  }
}

TEST(SinglePrecision, BatchGivesTheBitsOfItsItems) {
  const int batch = 3, blocks = 6, size = 13;
  SymmetricBlockTridiagonal many(blocks, size, batch), one(blocks, size);
  fill_random(many, nullptr, 6);
  Factorization f(blocks, size, Ordering::chunked, 3, batch, Isa::avx512, Precision::float32);
  f.factor(many, nullptr, 0.0, 2);
  const std::vector<double> rhs = random_vector(many.rows() * batch, 7);
  std::vector<double> x = rhs;
  f.solve(x.data(), 1, 2);
  for (int item = 0; item < batch; ++item) {
    std::copy_n(many.diagonal(0, item), blocks * size * size, one.diagonal(0));
    std::copy_n(many.lower(0, item), (blocks - 1) * size * size, one.lower(0));
    Factorization g = single(blocks, size, Ordering::chunked);
    g.factor(one);
    std::vector<double> y(rhs.begin() + item * one.rows(), rhs.begin() + (item + 1) * one.rows());
    g.solve(y.data());
    EXPECT_TRUE(std::equal(y.begin(), y.end(), x.begin() + item * one.rows())) << item;
  }
}

TEST(SinglePrecision, NamesWhatItCannotRepresent) {
  for (Ordering ordering : kOrderings) {
    SymmetricBlockTridiagonal a(4, 3);
    fill_random(a, nullptr, 8);
    a.diagonal(2)[4] = 1e39;
    Factorization f = single(4, 3, ordering);
    try {
      f.factor(a);
      ADD_FAILURE() << ordering_name(ordering);
    } catch (const FactorizationError& error) {
      EXPECT_EQ(error.block, 2);
      EXPECT_EQ(error.pivot, 1);
      EXPECT_NE(std::string(error.what()).find("not finite"), std::string::npos) << error.what();
    }
  }
}

}  // namespace
}  // namespace trajopt::linalg
