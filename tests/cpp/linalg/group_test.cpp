// The operations for groups of threads against the definition that the SIMD kernels equal too, bit
// for bit: with one rank, and with many that take their turns in either order, which shows races
// and a dependence on the order.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "linalg/random_matrix.h"
#include "linalg/reference.h"
#include "trajopt/base/buffer.h"
#include "trajopt/linalg/group_eliminate.h"
#include "trajopt/linalg/group_update.h"
#include "trajopt/linalg/group_vector.h"

namespace trajopt::linalg {
namespace {

using Values = std::vector<double>;
template <class T>
using ValuesOf = std::vector<T>;
using test::random_vector;

// What a matrix of doubles is to factors in T.
template <class T>
ValuesOf<T> rounded(const Values& a) {
  return ValuesOf<T>(a.begin(), a.end());
}

// A square matrix with padded rows; nothing behind the last element.
template <class T>
class Padded {
 public:
  explicit Padded(int n, const ValuesOf<T>& from = {})
      : n_(n), ld_((n + 3) / 4 * 4), data_((n - 1) * ld_ + n, T(-7)) {
    for (int i = 0; i < n && !from.empty(); ++i) {
      for (int j = 0; j < n; ++j) (*this)(i, j) = from[i * n + j];
    }
  }
  T* data() { return data_.data(); }
  const T* data() const { return data_.data(); }
  long ld() const { return ld_; }
  T& operator()(int i, int j) { return data_[i * ld_ + j]; }
  T operator()(int i, int j) const { return data_[i * ld_ + j]; }
  int size() const { return n_; }

 private:
  int n_;
  long ld_;
  ValuesOf<T> data_;
};

enum class Part { all, lower, strictly_lower };

template <class T>
bool same(T a, T b) {
  return std::memcmp(&a, &b, sizeof a) == 0;
}

template <class T>
void expect_same_bits(const Padded<T>& actual, const ValuesOf<T>& expected, const char* what,
                      Part part = Part::all) {
  const int n = actual.size();
  for (int i = 0; i < n; ++i) {
    const int columns = part == Part::all ? n : (part == Part::lower ? i + 1 : i);
    for (int j = 0; j < columns; ++j) {
      ASSERT_TRUE(same(actual(i, j), expected[i * n + j]))
          << what << " (" << i << ", " << j << "): " << actual(i, j) << " instead of "
          << expected[i * n + j];
    }
  }
}

// Exactly the bytes asked for, so that the address sanitizer sees every access beyond them.
class Space {
 public:
  explicit Space(std::size_t bytes) : data_(aligned_buffer(bytes)) {}
  void* get() const { return data_.get(); }
  template <class T>
  T* of() const {
    return static_cast<T*>(get());
  }

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
  Values random(unsigned seed) const { return random_vector(std::size_t(size()) * size(), seed); }
  template <class T>
  ValuesOf<T> random(unsigned seed) const {
    return rounded<T>(random(seed));
  }

  template <class T>
  void eliminate() const;
  template <class T>
  void eliminate_names_the_failing_pivot() const;
  template <class T>
  void update() const;
  template <class T>
  void vectors() const;
};

template <class T>
struct Eliminated {
  Padded<T> w, u, v_left, v_right, u_left, u_right;
  ValuesOf<T> inverse;
  explicit Eliminated(int n)
      : w(n), u(n), v_left(n), v_right(n), u_left(n), u_right(n), inverse(n) {}

  group::BasicElimination<T> task(const Values& original, const signed char* signs) {
    group::BasicElimination<T> e;
    e.size = w.size();
    e.ld = w.ld();
    e.original = original.data();
    e.diagonal = original.data();
    e.diagonal_ld = w.size();
    e.signs = signs;
    e.w = w.data();
    e.u = u.data();
    e.inverse = inverse.data();
    return e;
  }
};

template <class T>
void GroupTest::eliminate() const {
  const int n = size();
  const auto signs = test::mixed_signs(n, n);
  Values a = random(1);
  const Values left = random(2), right = random(3);
  Values right_transposed(n * n);
  for (int i = 0; i < n; ++i) {
    a[i * n + i] = signs[i] * (4.0 * n + 1.0 + a[i * n + i] * 0.1);
    for (int j = 0; j < n; ++j) right_transposed[j * n + i] = right[i * n + j];
    for (int j = i + 1; j < n; ++j) a[i * n + j] = std::nan("");
  }
  ValuesOf<T> w = rounded<T>(a), inverse(n);
  std::vector<ValuesOf<T>> v = {rounded<T>(left), rounded<T>(right)}, u;
  reference::eliminate(n, w, inverse, v, u, signs.data(), T(0.25));

  for (int couplings = 0; couplings < 4; ++couplings) {
    for_groups(n, [&](const auto& group) {
      for (bool in_place : {false, true}) {
        Eliminated<T> out(n);
        if (in_place) {  // as a block that was updated, and a coupling that is fill
          out.w = Padded<T>(n, rounded<T>(a));
          out.v_left = Padded<T>(n, rounded<T>(left));
        }
        group::BasicElimination<T> e = out.task(a, signs.data());
        e.regularization = 0.25;
        if (in_place) {
          e.diagonal = out.w.data();
          e.diagonal_ld = out.w.ld();
        }
        if (couplings & 1) {
          e.left = {left.data(), n, 1, out.v_left.data(), out.u_left.data()};
          if (in_place) e.left.source = out.v_left.data(), e.left.row = out.v_left.ld();
        }
        if (couplings & 2) {
          e.right = {right_transposed.data(), 1, n, out.v_right.data(), out.u_right.data()};
        }
        using Shared = group::BasicEliminationSpace<T>;
        const Space space(Shared::bytes(n));
        ASSERT_EQ(group::eliminate(group, e, Shared(space.get(), n)), -1);
        expect_same_bits(out.w, w, "W", Part::strictly_lower);
        ASSERT_EQ(std::memcmp(out.inverse.data(), inverse.data(), n * sizeof(T)), 0);
        if (couplings & 1) {
          expect_same_bits(out.v_left, v[0], "left V");
          expect_same_bits(out.u_left, u[0], "left U");
        }
        if (couplings & 2) {
          expect_same_bits(out.v_right, v[1], "right V");
          expect_same_bits(out.u_right, u[1], "right U");
        }
      }
    });
  }
}

// Of the numbers that are not finite or not zero in float64 some are in float32.
template <class T>
void GroupTest::eliminate_names_the_failing_pivot() const {
  const int n = size();
  const double inf = std::numeric_limits<double>::infinity();
  std::vector<double> values = {0.0, -0.0, -1e3, inf, -inf, 1e-310, std::nan("")};
  if (sizeof(T) == sizeof(float)) values.insert(values.end(), {1e-39, 1e39, -1e39});
  for (int bad : {0, n / 2, n - 1}) {
    for (double value : values) {
      Values a = random(1);
      for (int i = 0; i < n; ++i) {
        a[i * n + i] = 4.0 * n + 1.0;
        a[i * n + bad] = a[bad * n + i] = 0.0;  // coupled to nothing: the pivot is the element
      }
      a[bad * n + bad] = value;
      for_groups(n, [&](const auto& group) {
        Eliminated<T> out(n);
        const Space memory(group::BasicEliminationSpace<T>::bytes(n));
        const group::BasicEliminationSpace<T> space(memory.get(), n);
        ASSERT_EQ(group::eliminate(group, out.task(a, nullptr), space), bad) << value;
        const double expected = static_cast<T>(value);
        ASSERT_TRUE(same(space.failed->value, expected)) << space.failed->value;
      });
    }
  }
}

template <class T>
void GroupTest::update() const {
  const int n = size();
  const Values matrix = random(4);
  const ValuesOf<T> source = rounded<T>(matrix), v = random<T>(5), u = random<T>(6),
                    v2 = random<T>(7), u2 = random<T>(8);
  ValuesOf<T> once, expected, from_zero;
  reference::update(n, source, once, v, u);
  reference::update(n, once, expected, v2, u2);
  reference::update(n, ValuesOf<T>(n * n, T(0)), from_zero, v, u);
  const Padded<T> pv(n, v), pu(n, u), pv2(n, v2), pu2(n, u2);
  for_groups(n, [&](const auto& group) {
    const Space space(group::update_bytes<T>(n));
    const auto run = [&](const group::BasicUpdate<T>& p) {
      for (int i = 0; i < group::update_tiles(n); ++i) {
        for (int j = 0; j < (p.lower ? i + 1 : group::update_tiles(n)); ++j) {
          group::update_tile(group, p, i, j, space.get());
        }
      }
    };
    Padded<T> whole(n), lower(n, source), fill(n);
    group::BasicUpdate<T> p;
    p.size = n;
    p.depth = n;
    p.ld = pv.ld();
    p.source = matrix.data();
    p.source_ld = n;
    p.target = whole.data();
    p.target_ld = whole.ld();
    p.terms = 2;
    p.term[0] = {pv.data(), pu.data()};
    p.term[1] = {pv2.data(), pu2.data()};
    run(p);
    expect_same_bits(whole, expected, "whole");
    p.lower = true;
    p.target = lower.data();
    p.source = lower.data();
    p.source_ld = lower.ld();
    run(p);
    expect_same_bits(lower, expected, "lower", Part::lower);
    p.lower = false;
    p.source = {};
    p.target = fill.data();
    p.terms = 1;
    run(p);
    expect_same_bits(fill, from_zero, "from zero");
  });
}

template <class T>
void GroupTest::vectors() const {
  const int n = size();
  const ValuesOf<T> w = random<T>(9);
  const Padded<T> a(n, w);
  for (int m : {1, 3, 8}) {
    if (n > 100 && m == 3) continue;
    const ValuesOf<T> x = rounded<T>(random_vector(n * m, 10)),
                      start = rounded<T>(random_vector(n * m, 11));
    ValuesOf<T> expected[5] = {start, start, start, start, start};
    reference::subtract(n, n, w, x, expected[0], m);
    reference::subtract_transposed(n, n, w, x, expected[1], m);
    reference::subtract_symmetric(n, w, x, expected[2], m);
    reference::substitute(n, w, expected[3], m);
    reference::substitute_transposed(n, w, expected[4], m);
    for_groups(n, [&](const auto& group) {
      const Space space(group::vector_bytes<T>(n));
      T* s = space.of<T>();
      ValuesOf<T> y[5] = {start, start, start, start, start};
      group::subtract(group, n, n, a.data(), a.ld(), x.data(), y[0].data(), m, m, m, s);
      group::subtract_transposed(group, n, n, a.data(), a.ld(), x.data(), y[1].data(), m, m, m);
      group::subtract_symmetric(group, n, a.data(), a.ld(), x.data(), y[2].data(), m, m, m, s);
      group::substitute(group, n, a.data(), a.ld(), y[3].data(), m, m, s);
      group::substitute_transposed(group, n, a.data(), a.ld(), y[4].data(), m, m, s);
      const char* names[] = {"subtract", "subtract_transposed", "subtract_symmetric", "substitute",
                             "substitute_transposed"};
      for (int k = 0; k < 5; ++k) {
        ASSERT_EQ(std::memcmp(y[k].data(), expected[k].data(), sizeof(T) * n * m), 0)
            << names[k] << " with " << m << " columns";
      }
    });
  }
}

TEST_P(GroupTest, Eliminate) {
  eliminate<double>();
  eliminate<float>();
}

TEST_P(GroupTest, EliminateNamesTheFailingPivot) {
  eliminate_names_the_failing_pivot<double>();
  eliminate_names_the_failing_pivot<float>();
}

TEST_P(GroupTest, Update) {
  update<double>();
  update<float>();
}

TEST_P(GroupTest, Vectors) {
  vectors<double>();
  vectors<float>();
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
