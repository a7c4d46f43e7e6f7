// The launches that a device makes, made on the processor by emulated groups: the plan and every
// job against Factorization, bit for bit, with ranks and jobs in either order and factors of either
// precision.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <type_traits>
#include <vector>

#include "linalg/random_matrix.h"
#include "trajopt/base/buffer.h"
#include "trajopt/base/error.h"
#include "trajopt/linalg/factorization.h"
#include "trajopt/linalg/group_sequence.h"
#include "trajopt/linalg/pivot_error.h"

namespace trajopt::linalg {
namespace {

using test::fill_random;
using test::mixed_signs;
using test::random_vector;
using Values = std::vector<double>;

constexpr Ordering kOrderings[] = {Ordering::sequential, Ordering::cyclic, Ordering::chunked};

template <class T>
constexpr Precision kPrecision =
    std::is_same_v<T, double> ? Precision::float64 : Precision::float32;

template <class T>
Factorization on_processor(int blocks, int size, Ordering ordering, int chunks, int batch) {
  return Factorization(blocks, size, ordering, chunks, batch, Isa::avx512, kPrecision<T>);
}

// Runs the jobs of a launch one after the other.
struct EmulatedExecutor {
  RankOrder order;

  template <class Work>
  void operator()(const Work& work) const {
    ASSERT_LE(work.ranks(), Work::kMaxRanks);
    const Emulated group(work.ranks(), order);
    const long jobs = work.jobs();
    for (long j = 0; j < jobs; ++j) {
      const AlignedBuffer space = aligned_buffer(work.bytes());
      std::fill_n(space.get(), work.bytes(), std::byte{0xff});  // NaN: read before it is written
      work(group, order == RankOrder::forward ? j : jobs - 1 - j, space.get());
    }
  }
};

template <class T>
class Emulation {
 public:
  Emulation(const SymmetricBlockTridiagonal& a, Ordering ordering, int chunks, RankOrder order,
            bool stage_w)
      : plan_(make_group_plan(a.blocks(), make_schedule(a.blocks(), ordering, chunks))),
        run_{order} {
    const T nan = std::numeric_limits<T>::quiet_NaN();
    s_.blocks = a.blocks();
    s_.size = a.size();
    s_.batch = a.batch();
    s_.slots = plan_.slots;
    s_.runs = plan_.runs;
    s_.ld = group_ld<T>(a.size());
    s_.stage_w = stage_w;
    const long block = s_.block_length(), batch = a.batch();
    w_.assign(batch * a.blocks() * block, nan);
    couplings_.assign(batch * plan_.slots * block, nan);
    inverse_.assign(batch * a.rows(), nan);
    scratch_.assign(batch * plan_.runs * 3 * block, nan);
    failures_.assign(batch * plan_.runs, {-1, -1, 0.0});
    failed_stage_.assign(batch, GroupSystem::kNever);
    s_.diagonal = a.diagonal(0);
    s_.lower = a.blocks() > 1 ? a.lower(0) : nullptr;
    s_.w = w_.data();
    s_.couplings = couplings_.data();
    s_.inverse = inverse_.data();
    s_.scratch = scratch_.data();
    s_.failures = failures_.data();
    s_.failed_stage = failed_stage_.data();
    s_.failed_item = &failed_item_;
    s_.regularization = &regularization_;
  }

  void factor(const std::vector<signed char>& signs, double regularization) {
    s_.signs = signs.data();
    regularization_ = regularization;
    sequence_factor(run_, plan_, entries(), s_);
  }
  void solve(Values& x, int m) {
    sequence_solve(run_, plan_, entries(), s_, {x.data(), m, nullptr}, room(m));
    EXPECT_EQ(std::count(peak_.begin(), peak_.end(), 0.0), static_cast<long>(peak_.size()));
  }
  Refinement refine(const Values& rhs, Values& x, int m, int max_steps, double tolerance) {
    const long lanes = static_cast<long>(s_.batch) * column_chunks(m);
    Values r(x.size()), saved(x.size()), norm(lanes, 0.0);
    std::vector<GroupRefinement> states(lanes);
    std::vector<int> active(lanes);
    const RefineArrays arrays{rhs.data(),    r.data(),      saved.data(), norm.data(),
                              states.data(), active.data(), room(m)};
    sequence_refine_start(run_, s_, x.data(), m, max_steps, tolerance, arrays);
    for (int k = 0; k < max_steps; ++k) {
      sequence_refine_step(run_, plan_, entries(), s_, x.data(), m, max_steps, tolerance, arrays);
    }
    Refinement worst;
    for (const GroupRefinement& state : states) {
      worst.steps = std::max(worst.steps, state.steps);
      if (!(state.residual <= worst.residual)) worst.residual = state.residual;
    }
    return worst;
  }

  // The failure of the first item that has one.
  GroupFailure failure() const {
    GroupFailure lowest{-1, -1, 0.0};
    if (failed_item_ == GroupSystem::kNever) return lowest;
    for (int r = 0; r < plan_.runs; ++r) {
      const GroupFailure& f = s_.failure(failed_item_, r);
      if (f.block >= 0 && (lowest.block < 0 || f.block < lowest.block)) lowest = f;
    }
    return lowest;
  }
  int failed_item() const { return failed_item_; }

 private:
  GroupRounding room(int m) {
    const long columns = static_cast<long>(s_.batch) * m;
    rounded_.assign(columns * s_.blocks * s_.size, std::nanf(""));
    peak_.assign(columns, 0.0);
    scale_.assign(columns, std::nan(""));
    return {rounded_.data(), peak_.data(), scale_.data()};
  }
  PlanEntries entries() const { return {plan_.eliminations.data(), plan_.updates.data()}; }

  GroupPlan plan_;
  EmulatedExecutor run_;
  BasicGroupSystem<T> s_;
  std::vector<T> w_, couplings_, inverse_, scratch_;
  std::vector<float> rounded_;
  Values peak_, scale_;
  std::vector<GroupFailure> failures_;
  std::vector<int> failed_stage_;
  int failed_item_ = GroupSystem::kNever;
  double regularization_ = 0.0;
};

void expect_same_bits(const Values& actual, const Values& expected, const char* what) {
  ASSERT_EQ(actual.size(), expected.size());
  for (std::size_t i = 0; i < actual.size(); ++i) {
    ASSERT_EQ(std::memcmp(&actual[i], &expected[i], sizeof(double)), 0)
        << what << " element " << i << ": " << actual[i] << " instead of " << expected[i];
  }
}

template <class T>
void compare_in(int blocks, int size, int batch, Ordering ordering, int chunks, RankOrder order) {
  SCOPED_TRACE(precision_name(kPrecision<T>) + (" " + std::to_string(batch)) + " x " +
               std::to_string(blocks) + " blocks of " + std::to_string(size) + ", " +
               ordering_name(ordering) + " " + std::to_string(chunks) +
               (order == RankOrder::forward ? "" : ", reverse"));
  SymmetricBlockTridiagonal a(blocks, size, batch);
  const auto one = mixed_signs(a.rows(), size);
  std::vector<signed char> signs;
  for (int item = 0; item < batch; ++item) signs.insert(signs.end(), one.begin(), one.end());
  fill_random(a, signs.data(), 1);
  const double regularization = 1e-2;
  Factorization expected = on_processor<T>(blocks, size, ordering, chunks, batch);
  expected.factor(a, signs.data(), regularization);
  Emulation<T> actual(a, ordering, chunks, order, size % 2 == 0);
  actual.factor(signs, regularization);
  ASSERT_EQ(actual.failed_item(), GroupSystem::kNever);
  for (int m : {1, 2, 17}) {
    if (m == 17 && size * blocks > 400) continue;
    const Values rhs = random_vector(batch * a.rows() * m, 2);
    Values x = rhs, y = rhs;
    expected.solve(x.data(), m);
    actual.solve(y, m);
    expect_same_bits(y, x, "solve");
    for (double tolerance : {0.0, 1e-15, 1e-6}) {
      for (int steps : {0, 1, 20}) {
        Values better = x, other = x;
        const Refinement e = expected.refine(a, rhs.data(), better.data(), m, steps, tolerance);
        const Refinement f = actual.refine(rhs, other, m, steps, tolerance);
        ASSERT_EQ(f.steps, e.steps);
        expect_same_bits({f.residual}, {e.residual}, "residual");
        expect_same_bits(other, better, "refine");
      }
    }
  }
}

void compare(int blocks, int size, int batch, Ordering ordering, int chunks, RankOrder order) {
  compare_in<double>(blocks, size, batch, ordering, chunks, order);
  compare_in<float>(blocks, size, batch, ordering, chunks, order);
}

TEST(GroupFactorization, EveryOrderingAndLength) {
  for (int blocks : {1, 2, 3, 4, 5, 6, 7, 8, 9, 13, 16, 17, 31, 33}) {
    for (Ordering ordering : kOrderings) {
      for (int chunks : {1, 2, 3, 5}) {
        if (chunks > 1 && ordering != Ordering::chunked) continue;
        for (RankOrder order : {RankOrder::forward, RankOrder::reverse}) {
          compare(blocks, 5, 1, ordering, chunks, order);
          if (HasFatalFailure()) return;
        }
      }
    }
  }
}

TEST(GroupFactorization, SizesOfBlocks) {
  for (int size : {1, 2, 3, 4, 7, 8, 9, 16, 17, 24, 31, 40, 64, 72, 82, 130}) {
    compare(size > 60 ? 4 : 6, size, 1, Ordering::cyclic, 1, RankOrder::reverse);
    compare(size > 60 ? 3 : 5, size, 1, Ordering::chunked, 2, RankOrder::forward);
    if (HasFatalFailure()) return;
  }
}

TEST(GroupFactorization, Batches) {
  for (int batch : {0, 2, 5}) {
    for (Ordering ordering : kOrderings) {
      compare(7, 6, batch, ordering, 3, RankOrder::forward);
      compare(4, 9, batch, ordering, 2, RankOrder::reverse);
      if (HasFatalFailure()) return;
    }
  }
}

// Problems and columns that converge at different speeds, or not at all: each stops for itself.
template <class T>
void refinement_that_ends_apart() {
  SymmetricBlockTridiagonal a(6, 4, 3);
  fill_random(a, nullptr, 5);
  for (int k = 0; k < 6 * 16; ++k) a.diagonal(0, 1)[k] *= 0.01;  // regularization matters more
  for (int k = 0; k < 5 * 16; ++k) a.lower(0, 1)[k] *= 0.01;
  const std::vector<signed char> signs(3 * a.rows(), 1);
  const int m = 20;
  Values rhs = random_vector(3 * a.rows() * m, 6);
  for (long i = 0; i < 3 * a.rows(); ++i) rhs[i * m + 9] = 0.0;
  for (long i = 0; i < a.rows(); ++i) {
    for (int j = 0; j < 8; ++j) rhs[i * m + j] = 0.0;  // a chunk without anything to solve
  }
  rhs[(2 * a.rows() + 3) * m + 17] = std::nan("");
  for (double regularization : {1e-9, 0.3, 30.0}) {
    Factorization expected = on_processor<T>(6, 4, Ordering::cyclic, 1, 3);
    expected.factor(a, nullptr, regularization);
    Emulation<T> actual(a, Ordering::cyclic, 1, RankOrder::reverse, true);
    actual.factor(signs, regularization);
    ASSERT_EQ(actual.failed_item(), GroupSystem::kNever);
    Values x = rhs, y = rhs;
    expected.solve(x.data(), m);
    actual.solve(y, m);
    const Refinement e = expected.refine(a, rhs.data(), x.data(), m, 30, 1e-13);
    const Refinement f = actual.refine(rhs, y, m, 30, 1e-13);
    EXPECT_EQ(f.steps, e.steps);
    EXPECT_TRUE(std::isnan(e.residual) && std::isnan(f.residual));
    for (std::size_t i = 0; i < x.size(); ++i) {
      if (!std::isnan(x[i])) {
        ASSERT_EQ(std::memcmp(&x[i], &y[i], sizeof(double)), 0) << i;
      } else {
        ASSERT_TRUE(std::isnan(y[i])) << i;
      }
    }
  }
}

TEST(GroupFactorization, RefinementThatEndsApart) {
  refinement_that_ends_apart<double>();
  refinement_that_ends_apart<float>();
}

// Columns beyond float32's range on either side, subnormal ones, zeros and what is not finite, in a
// system of several rounding jobs: each column is scaled for itself.
TEST(GroupFactorization, RangeOfTheColumns) {
  const int blocks = 130, size = 9, m = 11, batch = 2;
  static_assert(blocks * size > 2 * group::kRoundRows);
  SymmetricBlockTridiagonal a(blocks, size, batch);
  fill_random(a, nullptr, 7);
  const std::vector<signed char> signs(batch * a.rows(), 1);
  const double scales[m] = {1.0,  1e300, 1e-300,  std::ldexp(1.0, 1015), 1e-320, 0.0, 1e40, 1e-50,
                            -3.0, 5e37,  INFINITY};
  Values rhs = random_vector(batch * a.rows() * m, 8);
  for (std::size_t i = 0; i < rhs.size(); ++i) rhs[i] *= scales[i % m];
  rhs[5 * m] = std::nan("");  // of the first column of the first problem
  for (RankOrder order : {RankOrder::forward, RankOrder::reverse}) {
    Factorization expected = on_processor<float>(blocks, size, Ordering::chunked, 2, batch);
    expected.factor(a);
    Emulation<float> actual(a, Ordering::chunked, 2, order, true);
    actual.factor(signs, 0.0);
    Values x = rhs, y = rhs;
    expected.solve(x.data(), m);
    actual.solve(y, m);
    for (std::size_t i = 0; i < x.size(); ++i) {
      const bool is_nan = std::isnan(x[i]) && std::isnan(y[i]);
      ASSERT_TRUE(is_nan || std::memcmp(&x[i], &y[i], sizeof(double)) == 0)
          << "column " << i % m << ": " << y[i] << " instead of " << x[i];
      const int column = static_cast<int>(i) % m;
      const bool finite = column != 10 && (column != 0 || i >= x.size() / 2);
      ASSERT_TRUE(!finite || std::isfinite(x[i])) << column;
    }
  }
}

// Failures: the same block, pivot and value as Factorization, whatever else fails later.
template <class T>
void expect_same_failure_in(const SymmetricBlockTridiagonal& a, const char* what,
                            double regularization) {
  const std::vector<signed char> signs(static_cast<std::size_t>(a.batch()) * a.rows(), 1);
  for (Ordering ordering : kOrderings) {
    SCOPED_TRACE(std::string(what) + ", " + ordering_name(ordering));
    Factorization expected = on_processor<T>(a.blocks(), a.size(), ordering, 3, a.batch());
    std::string words = "none";
    try {
      expected.factor(a, nullptr, regularization);
    } catch (const FactorizationError& error) {
      words = error.what();
    }
    for (RankOrder order : {RankOrder::forward, RankOrder::reverse}) {
      Emulation<T> actual(a, ordering, 3, order, true);
      actual.factor(signs, regularization);
      const GroupFailure f = actual.failure();
      const int item = a.batch() > 1 ? actual.failed_item() : -1;
      EXPECT_EQ(f.block < 0
                    ? "none"
                    : pivot_error(item, f.block, f.row, f.value, true, regularization).what(),
                words);
    }
  }
}

void expect_same_failure(const SymmetricBlockTridiagonal& a, const char* what,
                         double regularization = 0.0) {
  expect_same_failure_in<double>(a, what, regularization);
  expect_same_failure_in<float>(a, what, regularization);
}

TEST(GroupFactorizationFailure, EveryElementNotFinite) {
  const double bad[] = {std::nan(""), INFINITY, -INFINITY, 0.0, -0.0, -1e3, 1e39, -1e39, 1e-42};
  for (int size : {1, 3, 9}) {
    for (int kind = 0; kind < 9; ++kind) {
      for (int where = 0; where < 5 * size * size; ++where) {
        SymmetricBlockTridiagonal a(3, size);
        fill_random(a, nullptr, 14);
        const int block = where / (size * size), at = where % (size * size);
        if (block < 3 && at % size > at / size) continue;  // upper triangle
        (block < 3 ? a.diagonal(block) : a.lower(block - 3))[at] = bad[kind];
        expect_same_failure(a, "one element");
      }
    }
  }
}

// What float32 takes for singular float64 does not; a regularization that float32 rounds to zero.
TEST(GroupFactorizationFailure, PivotsAtWorkingAccuracy) {
  for (double excess : {0.0, 1e-16, 1e-12, 1e-7, 3e-7, 5e-7, 1e-6, 1e-3}) {
    for (double regularization : {0.0, 1e-50, 1e-9, 1e-3}) {
      SymmetricBlockTridiagonal a(4, 2);
      for (int i = 0; i < 4; ++i) {  // springs in a chain that is held by `excess` alone
        const bool end = i == 0 || i == 3;
        a.diagonal(i)[0] = 3.0, a.diagonal(i)[2] = 0.0;
        a.diagonal(i)[3] = (end ? 1.0 : 2.0) + excess;
        for (int k = 0; k < 4 && i < 3; ++k) a.lower(i)[k] = k == 3 ? -1.0 : 0.0;
      }
      expect_same_failure(a, "nearly singular", regularization);
    }
  }
}

TEST(GroupFactorizationFailure, SeveralBlocksAndItems) {
  for (int first = 0; first < 9; ++first) {
    for (int second = first; second < 9; ++second) {
      SymmetricBlockTridiagonal a(9, 4, 3);
      fill_random(a, nullptr, 15);
      a.diagonal(first, 2)[5] = -1.0;
      a.diagonal(second, 2)[10] = std::nan("");
      if (second % 2) a.diagonal(second, 1)[0] = 0.0;
      expect_same_failure(a, "two blocks");
    }
  }
}

}  // namespace
}  // namespace trajopt::linalg
