// What cannot be factored is refused with the block and the pivot, on every ordering and in both
// precisions, and sizes that no machine has memory for are refused before anything is touched.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "linalg/random_matrix.h"
#include "trajopt/base/error.h"
#include "trajopt/linalg/bordered.h"
#include "trajopt/linalg/factorization.h"

namespace trajopt::linalg {
namespace {

constexpr Ordering kOrderings[] = {Ordering::automatic, Ordering::sequential, Ordering::cyclic,
                                   Ordering::chunked};
constexpr Precision kPrecisions[] = {Precision::float64, Precision::float32};

// A block that is coupled to nothing, so that every ordering meets the same pivots in it.
void isolate(SymmetricBlockTridiagonal& a, int block) {
  const int entries = a.size() * a.size();
  if (block > 0) std::fill_n(a.lower(block - 1), entries, 0.0);
  if (block + 1 < a.blocks()) std::fill_n(a.lower(block), entries, 0.0);
}

void expect_failure(const SymmetricBlockTridiagonal& a, const signed char* signs, int block,
                    int pivot, const char* words) {
  for (Ordering ordering : kOrderings) {
    for (Precision precision : kPrecisions) {
      const std::string where = std::string(ordering_name(ordering)) + " " +
                                precision_name(precision) + " " + std::to_string(a.blocks()) +
                                " x " + std::to_string(a.size());
      Factorization f(a.blocks(), a.size(), ordering, 3, 1, Isa::avx512, precision);
      EXPECT_FALSE(f.try_factor(a, signs, 0.0, 2)) << where;
      EXPECT_FALSE(f.factored());
      try {
        f.factor(a, signs, 0.0, 2);
        ADD_FAILURE() << "factored: " << where;
      } catch (const FactorizationError& error) {
        EXPECT_EQ(error.block, block) << where << ": " << error.what();
        EXPECT_EQ(error.pivot, pivot) << where << ": " << error.what();
        EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
      }
      EXPECT_FALSE(f.factored());
      std::vector<double> x(a.rows(), 1.0);
      EXPECT_THROW(f.solve(x.data()), ArgumentError);
    }
  }
}

class Sizes : public testing::TestWithParam<int> {};

// The bad pivot is met first, last and in between; n = 1, odd, and on both sides of a power of two.
TEST_P(Sizes, BadPivotsAreNamed) {
  const int size = GetParam();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (int blocks : {1, 2, 7, 9}) {
    for (int block : {0, blocks / 2, blocks - 1}) {
      for (int row : {0, size / 2, size - 1}) {
        SymmetricBlockTridiagonal good(blocks, size);
        const auto signs = test::mixed_signs(good.rows(), size);
        test::fill_random(good, signs.data(), 1);
        isolate(good, block);
        double* d = good.diagonal(block);
        const double before = d[row * size + row];
        d[row * size + row] = nan;
        expect_failure(good, signs.data(), block, row, "not finite");
        d[row * size + row] = -100.0 * before;
        expect_failure(good, signs.data(), block, row, "wrong sign");
        for (int s = 0; s < size; ++s) d[std::max(row, s) * size + std::min(row, s)] = 0.0;
        expect_failure(good, signs.data(), block, row, "zero");
      }
      if (block == blocks - 1) break;  // of one block: once
    }
  }
}

INSTANTIATE_TEST_SUITE_P(OfBlocks, Sizes,
                         testing::Values(1, 2, 3, 5, 7, 8, 9, 11, 12, 15, 16, 17, 24, 31, 33),
                         testing::PrintToStringParamName());

TEST(Failure, LargeBlocks) {
  for (int size : {64, 96, 130, 176, 255, 256}) {
    SymmetricBlockTridiagonal a(3, size);
    test::fill_random(a, nullptr, 2);
    isolate(a, 1);
    a.diagonal(1)[(size / 3) * (size + 1)] = -1e4 * size;
    expect_failure(a, nullptr, 1, size / 3, "wrong sign");
  }
}

// Singular only as a whole: every block is fine, the Schur complement of the last one is not.
TEST(Failure, SingularOnlyTogether) {
  for (int blocks : {2, 3, 5, 8}) {
    SymmetricBlockTridiagonal a(blocks, 1);
    for (int i = 0; i < blocks; ++i) {  // springs in a chain that is held nowhere
      a.diagonal(i)[0] = i == 0 || i + 1 == blocks ? 1.0 : 2.0;
      if (i + 1 < blocks) a.lower(i)[0] = -1.0;
    }
    for (Ordering ordering : kOrderings) {
      for (Precision precision : kPrecisions) {
        Factorization f(blocks, 1, ordering, 3, 1, Isa::avx512, precision);
        EXPECT_THROW(f.factor(a), FactorizationError) << blocks << " " << ordering_name(ordering);
      }
    }
  }
}

TEST(Failure, OfABorder) {
  SymmetricBlockTridiagonal k(4, 5);
  test::fill_random(k, nullptr, 3);
  const std::vector<double> e(k.rows() * 2, 0.0);
  for (double bad : {0.0, -1.0, std::nan("")}) {
    const std::vector<double> f = {1.0, 0.0, 0.0, bad};
    BorderedFactorization bordered(4, 5, 2);
    try {
      bordered.factor(k, e.data(), f.data());
      ADD_FAILURE() << bad;
    } catch (const FactorizationError& error) {
      EXPECT_EQ(error.block, 4);
      EXPECT_EQ(error.pivot, 1);
    }
  }
}

TEST(Failure, EmptyBatchIsNone) {
  for (Ordering ordering : kOrderings) {
    for (Precision precision : kPrecisions) {
      const SymmetricBlockTridiagonal a(4, 3, 0);
      Factorization f(4, 3, ordering, 2, 0, Isa::avx512, precision);
      f.factor(a, nullptr, 0.0, 2);
      f.solve(nullptr, 2, 2);
      EXPECT_TRUE(f.factored());
    }
  }
}

TEST(Failure, AFailureLeavesTheFactorizationUsable) {
  SymmetricBlockTridiagonal good(6, 9), bad(6, 9);
  test::fill_random(good, nullptr, 4);
  test::fill_random(bad, nullptr, 5);
  bad.diagonal(3)[0] = std::nan("");
  const std::vector<double> rhs = test::random_vector(good.rows(), 6);
  for (Ordering ordering : kOrderings) {
    Factorization fresh(6, 9, ordering, 3), used(6, 9, ordering, 3);
    EXPECT_THROW(used.factor(bad, nullptr, 0.0, 2), FactorizationError);
    used.factor(good, nullptr, 0.0, 2);
    fresh.factor(good);
    std::vector<double> x = rhs, y = rhs;
    used.solve(x.data());
    fresh.solve(y.data());
    EXPECT_EQ(x, y) << ordering_name(ordering);
  }
}

TEST(Failure, MoreThanTheMachinesMemory) {
  const int most = std::numeric_limits<int>::max();
  const auto expect_refusal = [](const auto& make) {
    try {
      make();
      ADD_FAILURE() << "got the memory";
    } catch (const MemoryError& error) {
      EXPECT_NE(std::string(error.what()).find("GiB"), std::string::npos) << error.what();
    }
  };
  // Petabytes, and products that leave 64 bits.
  expect_refusal([] { SymmetricBlockTridiagonal(1 << 20, 4096); });
  expect_refusal([=] { SymmetricBlockTridiagonal(most, most, most); });
  expect_refusal([] { Factorization(1 << 10, 1 << 16); });
  expect_refusal([] {
    Factorization(1 << 10, 1 << 16, Ordering::cyclic, 2, 1, Isa::avx512, Precision::float32);
  });
  expect_refusal([=] { Factorization(4, 1 << 10, Ordering::sequential, 2, most); });
}

}  // namespace
}  // namespace trajopt::linalg
