// Rounding of right-hand sides for float32 factors, launch by launch: with one rank, and with many
// that take their turns in either order.
#include "trajopt/linalg/group_round.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "linalg/random_matrix.h"

namespace trajopt::linalg {
namespace {

using Values = std::vector<double>;

constexpr int kBlocks = 61, kSize = 9, kBatch = 3;
constexpr int kRows = kBlocks * kSize;
static_assert(kRows > group::kRoundRows && kRows % group::kRoundRows != 0);

GroupMatrix shape() {
  GroupMatrix s;
  s.blocks = kBlocks;
  s.size = kSize;
  s.batch = kBatch;
  return s;
}

template <class Group, class Work>
void run(const Group& group, const Work& work) {
  Values space(work.bytes() / sizeof(double), std::nan(""));
  for (long job = work.jobs() - 1; job >= 0; --job) work(group, job, space.data());
}

// body(group) for a group of one and for emulated groups.
template <class Body>
void for_groups(const Body& body) {
  body(Serial{});
  for (int ranks : {3, 32, 96, 256}) {
    for (RankOrder order : {RankOrder::forward, RankOrder::reverse}) {
      SCOPED_TRACE(std::to_string(ranks) + " ranks");
      body(Emulated(ranks, order));
      if (testing::Test::HasFatalFailure()) return;
    }
  }
}

TEST(GroupRound, PeakOfEveryColumnWhereverItIs) {
  for (int m : {1, 2, 5, 8, 11}) {
    Values x = test::random_vector(static_cast<std::size_t>(kBatch) * kRows * m, m);
    for (double& value : x) value = std::copysign(std::min(std::abs(value), 5.0), value);
    for_groups([&](const auto& group) {
      for (int row = 0; row < kRows; row += m == 1 ? 1 : 7) {
        // The largest element of a column is in another row of every column.
        Values y = x, expected(kBatch * m), peak(kBatch * m, 0.0);
        for (int at = 0; at < kBatch * m; ++at) {
          const int item = at / m, column = at % m;
          expected[at] = 10.0 + at;
          y[(static_cast<long>(item) * kRows + (row + at) % kRows) * m + column] =
              at % 2 ? expected[at] : -expected[at];
        }
        run(group, group::PeakWork{shape(), {y.data(), m, nullptr}, peak.data()});
        ASSERT_EQ(peak, expected) << "row " << row << ", " << m << " columns";
      }
    });
  }
}

TEST(GroupRound, NotANumberIsAPeak) {
  for_groups([&](const auto& group) {
    Values y(kBatch * kRows * 2, 1.0), peak(kBatch * 2, 0.0);
    y[(kRows + 300) * 2 + 1] = -std::nan("");
    y[(kRows + 301) * 2 + 1] = INFINITY;
    run(group, group::PeakWork{shape(), {y.data(), 2, nullptr}, peak.data()});
    for (int at = 0; at < kBatch * 2; ++at) {
      ASSERT_TRUE(at == 3 ? std::isnan(peak[at]) : peak[at] == 1.0) << at;
    }
  });
}

TEST(GroupRound, ThereAndBack) {
  const int m = 11;
  const Values x = test::random_vector(kBatch * kRows * m, 3);
  Values peaks(kBatch * m);
  for (int at = 0; at < kBatch * m; ++at) peaks[at] = std::ldexp(1.3, 40 * (at - 16));
  for_groups([&](const auto& group) {
    Values y = x, peak = peaks, scale(kBatch * m);
    std::vector<float> rounded(x.size());
    const GroupRounding room{rounded.data(), peak.data(), scale.data()};
    run(group, group::RoundWork{shape(), {y.data(), m, nullptr}, room});
    run(group, group::RestoreWork{shape(), {y.data(), m, nullptr}, room});
    for (std::size_t i = 0; i < x.size(); ++i) {
      const std::size_t column = i / (kRows * m) * m + i % m;
      const double divisor = std::ldexp(1.0, 40 * (static_cast<int>(column) - 16));
      const float expected = static_cast<float>(x[i] / divisor);
      ASSERT_EQ(rounded[i], expected) << i;
      ASSERT_EQ(y[i], expected * divisor) << i;
    }
    EXPECT_EQ(peak, Values(kBatch * m, 0.0));
  });
}

// Only what is listed, and of that only the chunks that go on.
TEST(GroupRound, LeavesTheOthersAlone) {
  const int m = 11;
  const Values x = test::random_vector(kBatch * kRows * m, 4);
  const int listed[] = {2, 2, 0};
  const int active[] = {1, 0, 1, 1, 0, 1};  // (batch, 2)
  GroupMatrix s = shape();
  s.listed = listed;
  for_groups([&](const auto& group) {
    Values y = x, peak(kBatch * m, 0.0), scale(kBatch * m, 0.0);
    std::vector<float> rounded(x.size(), 1.0f);
    const GroupVectors v{y.data(), m, active};
    const GroupRounding room{rounded.data(), peak.data(), scale.data()};
    run(group, group::PeakWork{s, v, peak.data()});
    for (int at = 0; at < kBatch * m; ++at) {
      const bool chosen = (at / m == 0 && at % m < 8) || (at / m == 2 && at % m >= 8);
      ASSERT_EQ(peak[at] > 0.0, chosen) << at;
    }
    run(group, group::RoundWork{s, v, room});
    std::fill(rounded.begin(), rounded.end(), 0.0f);
    run(group, group::RestoreWork{s, v, room});
    for (std::size_t i = 0; i < x.size(); ++i) {
      const std::size_t item = i / (kRows * m), column = i % m;
      const bool chosen = (item == 0 && column < 8) || (item == 2 && column >= 8);
      ASSERT_EQ(y[i], chosen ? 0.0 : x[i]) << i;
    }
    EXPECT_EQ(peak, Values(kBatch * m, 0.0));
  });
}

}  // namespace
}  // namespace trajopt::linalg
