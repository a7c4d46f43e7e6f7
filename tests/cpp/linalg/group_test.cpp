// The operations for groups of threads against the SIMD kernels, bit for bit: with one rank, and
// with many that take their turns in either order, which shows races and a dependence on the order.
#include <gtest/gtest.h>

#include <cstring>
#include <string>
#include <tuple>
#include <vector>

#include "linalg/random_matrix.h"
#include "trajopt/base/buffer.h"
#include "trajopt/linalg/block_buffer.h"
#include "trajopt/linalg/block_kernels.h"
#include "trajopt/linalg/group_eliminate.h"
#include "trajopt/linalg/group_update.h"
#include "trajopt/linalg/group_vector.h"

namespace trajopt::linalg {
namespace {

// A matrix with padded rows and spare memory behind the end, as the SIMD kernels want it.
class Padded {
 public:
  Padded(int rows, int columns, unsigned seed) : Padded(rows, columns) {
    const std::vector<double> from = test::random_vector(std::size_t(rows) * columns, seed);
    for (int i = 0; i < rows; ++i) std::copy_n(&from[i * columns], columns, data() + i * ld_);
  }
  Padded(int rows, int columns)
      : rows_(rows), columns_(columns), ld_(padded(columns)), buffer_(rows * padded(columns)) {}
  double* data() const { return buffer_.data(); }
  long ld() const { return ld_; }
  double& operator()(int i, int j) const { return data()[i * ld_ + j]; }
  int rows() const { return rows_; }
  int columns() const { return columns_; }

 private:
  int rows_, columns_;
  long ld_;
  BlockBuffer buffer_;
};

enum class Part { all, lower, strictly_lower };

void expect_same_bits(const Padded& actual, const Padded& expected, const char* what,
                      Part part = Part::all) {
  for (int i = 0; i < expected.rows(); ++i) {
    const int all = expected.columns();
    const int columns = part == Part::all ? all : (part == Part::lower ? i + 1 : i);
    for (int j = 0; j < columns; ++j) {
      ASSERT_EQ(std::memcmp(&actual(i, j), &expected(i, j), sizeof(double)), 0)
          << what << " (" << i << ", " << j << "): " << actual(i, j) << " instead of "
          << expected(i, j);
    }
  }
}

void copy(const Padded& from, const Padded& to) {
  std::copy_n(from.data(), from.rows() * from.ld(), to.data());
}

// Exactly the bytes asked for, so that the address sanitizer sees every access beyond them.
class Space {
 public:
  explicit Space(std::size_t bytes) : data_(aligned_buffer(bytes)) {}
  void* get() const { return data_.get(); }
  double* doubles() const { return static_cast<double*>(get()); }

 private:
  AlignedBuffer data_;
};

// Runs body(group) for a group of one and for emulated groups.
template <class Body>
void for_groups(int size, const Body& body) {
  body(Serial{});
  for (int ranks : {3, 32, 96, 289}) {
    if (size > 64 && ranks != 96) continue;
    for (RankOrder order : {RankOrder::forward, RankOrder::reverse}) {
      SCOPED_TRACE(std::to_string(ranks) + " ranks" +
                   (order == RankOrder::forward ? "" : " in reverse"));
      body(Emulated(ranks, order));
      if (testing::Test::HasFatalFailure()) return;
    }
  }
}

class GroupTest : public testing::TestWithParam<int> {
 protected:
  int size() const { return GetParam(); }
  const BlockKernels& kernels() const { return block_kernels(Isa::avx512); }
};

struct Eliminated {
  Padded w, u, v_left, v_right, u_left, u_right;
  std::vector<double> inverse;
  explicit Eliminated(int n)
      : w(n, n), u(n, n), v_left(n, n), v_right(n, n), u_left(n, n), u_right(n, n), inverse(n) {}
};

TEST_P(GroupTest, Eliminate) {
  const int n = size();
  const auto signs = test::mixed_signs(n, n);
  const Padded a(n, n, 1), left(n, n, 2), right(n, n, 3);
  std::vector<double> original(n * n);
  for (int i = 0; i < n; ++i) {
    a(i, i) = signs[i] * (4.0 * n + 1.0 + a(i, i) * 0.1);
    for (int j = i + 1; j < n; ++j) a(i, j) = std::nan("");
    std::copy_n(&a(i, 0), n, &original[i * n]);
  }
  for (bool with_left : {true, false}) {
    for (bool with_right : {true, false}) {
      Eliminated expected(n);
      Elimination e;
      e.size = n;
      e.ld = e.diagonal_ld = a.ld();
      e.diagonal = a.data();
      e.original = original.data();
      e.signs = signs.data();
      e.regularization = 0.25;
      e.w = expected.w.data();
      e.u = expected.u.data();
      e.inverse = expected.inverse.data();
      if (with_left) {
        e.left = {left.data(), left.ld(), expected.v_left.data(), expected.u_left.data()};
      }
      if (with_right) {
        e.right = {right.data(), right.ld(), expected.v_right.data(), expected.u_right.data()};
      }
      ASSERT_EQ(kernels().eliminate(e).row, -1);

      for_groups(n, [&](const auto& group) {
        Eliminated actual(n);
        copy(a, actual.w);  // in place, as a block that has been updated before
        const Padded transposed(n, n);
        kernels().transpose(n, right.data(), right.ld(), transposed.data(), transposed.ld());
        copy(left, actual.v_left);
        group::Elimination g;
        g.size = n;
        g.ld = g.diagonal_ld = a.ld();
        g.diagonal = g.w = actual.w.data();
        g.original = original.data();
        g.signs = signs.data();
        g.regularization = 0.25;
        g.u = actual.u.data();
        g.inverse = actual.inverse.data();
        if (with_left) {
          g.left = {actual.v_left.data(), a.ld(), 1, actual.v_left.data(), actual.u_left.data()};
        }
        if (with_right) {
          g.right = {transposed.data(), 1, transposed.ld(), actual.v_right.data(),
                     actual.u_right.data()};
        }
        const Space space(group::EliminationSpace::bytes(n));
        ASSERT_EQ(group::eliminate(group, g, group::EliminationSpace(space.get(), n)), -1);
        expect_same_bits(actual.w, expected.w, "W", Part::strictly_lower);
        ASSERT_EQ(std::memcmp(actual.inverse.data(), expected.inverse.data(), n * 8), 0);
        if (with_left) {
          expect_same_bits(actual.v_left, expected.v_left, "left V");
          expect_same_bits(actual.u_left, expected.u_left, "left U");
        }
        if (with_right) {
          expect_same_bits(actual.v_right, expected.v_right, "right V");
          expect_same_bits(actual.u_right, expected.u_right, "right U");
        }
      });
    }
  }
}

TEST_P(GroupTest, EliminateNamesTheFailingPivot) {
  const int n = size();
  for (int bad : {0, n / 2, n - 1}) {
    for (double value : {0.0, -1e3, double(INFINITY), std::nan("")}) {
      const Padded a(n, n, 1);
      std::vector<double> original(n * n);
      for (int i = 0; i < n; ++i) {
        a(i, i) = 4.0 * n + 1.0;
        for (int j = 0; j < n; ++j) {
          if (i == bad && j < i) a(i, j) = 0.0;
          if (j == bad && i > j) a(i, j) = 0.0;
        }
        if (i == bad) a(i, i) = value;
        std::copy_n(&a(i, 0), n, &original[i * n]);
      }
      Eliminated space(n);
      Elimination e;
      e.size = n;
      e.ld = e.diagonal_ld = a.ld();
      e.diagonal = a.data();
      e.original = original.data();
      e.w = space.w.data();
      e.u = space.u.data();
      e.inverse = space.inverse.data();
      const Pivot expected = kernels().eliminate(e);
      ASSERT_EQ(expected.row, bad);
      for_groups(n, [&](const auto& group) {
        Eliminated out(n);
        group::Elimination g;
        g.size = n;
        g.ld = g.diagonal_ld = a.ld();
        g.diagonal = a.data();
        g.original = original.data();
        g.w = out.w.data();
        g.u = out.u.data();
        g.inverse = out.inverse.data();
        const Space memory(group::EliminationSpace::bytes(n));
        const group::EliminationSpace shared(memory.get(), n);
        ASSERT_EQ(group::eliminate(group, g, shared), expected.row);
        ASSERT_EQ(std::memcmp(&shared.failed->value, &expected.value, 8), 0);
      });
    }
  }
}

TEST_P(GroupTest, Update) {
  const int n = size();
  const Padded source(n, n, 4), v(n, n, 5), u(n, n, 6), v2(n, n, 7), u2(n, n, 8);
  const Padded expected(n, n), negative(n, n);
  kernels().update(n, n, n, source.data(), source.ld(), expected.data(), expected.ld(), v.data(),
                   u.data(), v.ld(), false);
  kernels().update(n, n, n, expected.data(), expected.ld(), expected.data(), expected.ld(),
                   v2.data(), u2.data(), v2.ld(), false);
  kernels().update(n, n, n, nullptr, 0, negative.data(), negative.ld(), v.data(), u.data(), v.ld(),
                   false);
  for_groups(n, [&](const auto& group) {
    const Space space(group::update_bytes(n));
    const auto run = [&](group::Update p) {
      for (int i = 0; i < group::update_tiles(n); ++i) {
        for (int j = 0; j < (p.lower ? i + 1 : group::update_tiles(n)); ++j) {
          group::update_tile(group, p, i, j, space.get());
        }
      }
    };
    const Padded whole(n, n), lower(n, n), from_zero(n, n);
    copy(source, lower);
    group::Update p;
    p.size = n;
    p.ld = v.ld();
    p.source = source.data();
    p.source_ld = p.target_ld = source.ld();
    p.target = whole.data();
    p.terms = 2;
    p.term[0] = {v.data(), u.data()};
    p.term[1] = {v2.data(), u2.data()};
    run(p);
    expect_same_bits(whole, expected, "whole");
    p.lower = true;
    p.source = p.target = lower.data();
    run(p);
    expect_same_bits(lower, expected, "lower", Part::lower);
    for (int i = 0; i < n; ++i) {
      for (int j = i + 1; j < n; ++j) {
        ASSERT_EQ(lower(i, j), source(i, j)) << "wrote above the diagonal";
      }
    }
    p.lower = false;
    p.source = nullptr;
    p.target = from_zero.data();
    p.terms = 1;
    run(p);
    expect_same_bits(from_zero, negative, "from zero");
  });
}

TEST_P(GroupTest, Vectors) {
  const int n = size();
  const Padded w(n, n, 9);
  for (int m : {1, 3, 8}) {
    if (n > 100 && m == 3) continue;
    const std::vector<double> x = test::random_vector(n * m, 10);
    const std::vector<double> start = test::random_vector(n * m, 11);
    std::vector<double> expected[5] = {start, start, start, start, start};
    kernels().subtract(n, n, w.data(), w.ld(), x.data(), expected[0].data(), m, m, m);
    kernels().subtract_transposed(n, n, w.data(), w.ld(), x.data(), expected[1].data(), m, m, m);
    kernels().subtract_symmetric(n, w.data(), w.ld(), x.data(), expected[2].data(), m, m, m);
    kernels().substitute(n, w.data(), w.ld(), expected[3].data(), m, m);
    kernels().substitute_transposed(n, w.data(), w.ld(), expected[4].data(), m, m);
    for_groups(n, [&](const auto& group) {
      const Space space(group::vector_bytes(n));
      double* s = space.doubles();
      std::vector<double> y[5] = {start, start, start, start, start};
      group::subtract(group, n, n, w.data(), w.ld(), x.data(), y[0].data(), m, m, m, s);
      group::subtract_transposed(group, n, n, w.data(), w.ld(), x.data(), y[1].data(), m, m, m);
      group::subtract_symmetric(group, n, w.data(), w.ld(), x.data(), y[2].data(), m, m, m, s);
      group::substitute(group, n, w.data(), w.ld(), y[3].data(), m, m, s);
      group::substitute_transposed(group, n, w.data(), w.ld(), y[4].data(), m, m, s);
      const char* names[] = {"subtract", "subtract_transposed", "subtract_symmetric", "substitute",
                             "substitute_transposed"};
      for (int k = 0; k < 5; ++k) {
        ASSERT_EQ(std::memcmp(y[k].data(), expected[k].data(), 8 * y[k].size()), 0)
            << names[k] << " with " << m << " columns";
      }
    });
  }
}

std::vector<int> sizes() {
  std::vector<int> all;
  for (int n = 1; n <= 64; ++n) all.push_back(n);
  for (int n : {65, 72, 82, 96, 127, 130, 176, 255, 256}) all.push_back(n);
  return all;
}

INSTANTIATE_TEST_SUITE_P(Sizes, GroupTest, testing::ValuesIn(sizes()),
                         [](const auto& info) { return std::to_string(info.param); });

}  // namespace
}  // namespace trajopt::linalg
