// The tree of a sum against a recursive definition, for every group, and what a norm must not hide.
#include "trajopt/base/reduction.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace trajopt {
namespace {

std::vector<double> random_values(long count) {
  std::mt19937_64 generator(static_cast<unsigned>(count));
  std::normal_distribution<double> normal;
  std::vector<double> v(count);
  for (double& x : v) x = std::exp(5 * normal(generator)) * normal(generator);
  return v;
}

// Slots first, first + stride, ... of a chunk, as the header describes the tree.
double chunk_sum(const std::vector<double>& v, long begin, int first, int stride) {
  if (stride == kTreeWidth) {
    const std::size_t at = begin + first;
    return at < v.size() ? v[at] : 0.0;
  }
  return chunk_sum(v, begin, first, 2 * stride) + chunk_sum(v, begin, first + stride, 2 * stride);
}

double tree_sum(const std::vector<double>& v) {
  std::vector<double> chunks;
  for (long begin = 0; begin < static_cast<long>(v.size()); begin += kTreeWidth)
    chunks.push_back(chunk_sum(v, begin, 0, 1));
  return chunks.size() == 1 ? chunks[0] : tree_sum(chunks);
}

TEST(Reduction, IsTheTreeItSays) {
  for (long count : {1, 2, 63, 64, 65, 400, 4096, 4097, 300000}) {
    std::vector<double> v = random_values(count);
    const double expected = tree_sum(v);
    long double exact = 0, size = 0;
    for (double x : v) exact += x, size += std::abs(x);
    EXPECT_EQ(folded<Sum>(v.data(), count), expected) << count;
    EXPECT_NEAR(static_cast<double>(exact), expected, 1e-14 * static_cast<double>(size));
  }
}

TEST(Reduction, SameBitsForEveryGroup) {
  for (long count : {1, 65, 400, 5000}) {
    const std::vector<double> v = random_values(count);
    std::vector<double> serial = v;
    const double expected = folded<Sum>(serial.data(), count);
    for (int size : {1, 7, 32, 128}) {
      for (RankOrder order : {RankOrder::forward, RankOrder::reverse}) {
        std::vector<double> values = v, slots(kTreeWidth, std::nan(""));
        fold_tree<Sum>(Emulated(size, order), values.data(), count, slots.data());
        EXPECT_EQ(values[0], expected) << count << " values, group of " << size;
      }
    }
  }
}

TEST(Reduction, LargestHidesNothing) {
  EXPECT_EQ(magnitude(-3.0), 3.0);
  EXPECT_EQ(magnitude(std::nan("")), HUGE_VAL);
  EXPECT_EQ(magnitude(-std::numeric_limits<double>::infinity()), HUGE_VAL);
  std::vector<double> v = random_values(1000);
  double expected = 0;
  for (double& x : v) expected = std::max(expected, x = magnitude(x));
  std::vector<double> copy = v;
  EXPECT_EQ(folded<Largest>(copy.data(), 1000), expected);
  v[700] = magnitude(std::nan(""));
  EXPECT_EQ(folded<Largest>(v.data(), 1000), HUGE_VAL);
}

TEST(Reduction, NothingIsZero) { EXPECT_EQ(folded<Sum>(nullptr, 0), 0.0); }

}  // namespace
}  // namespace trajopt
