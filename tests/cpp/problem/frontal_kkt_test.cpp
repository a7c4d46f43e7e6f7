// Frame by frame elimination against a dense matrix written down from the definition of its
// entries.
#include "trajopt/problem/frontal_kkt.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "problem/fixtures.h"
#include "trajopt/base/error.h"

namespace trajopt {
namespace {

constexpr double kEpsilon = 1e-9;

struct Shape {
  int nodes, primal, dual;
};

void PrintTo(const Shape& s, std::ostream* out) {
  *out << s.nodes << " nodes of " << s.primal << " + " << s.dual;
}

// Random and quasi-definite, with couplings of the size of what is coupled.
struct Matrix {
  explicit Matrix(Shape s, double smoothing = 60.0, double damping = 0.01)
      : rows{s.nodes, s.primal, s.dual, smoothing, damping, nullptr} {
    test::Random random(s.nodes * 100 + s.primal + s.dual);
    data.assign(s.nodes * rows.length() + 64, 0.0);
    const int d = s.primal, m = s.dual;
    const double size = 0.3 / std::sqrt(d);
    for (int i = 0; i < s.nodes; ++i) {
      for (int r = 0; r < rows.width(); ++r) {
        for (int c = 0; c < rows.columns(); ++c) {
          const bool before = (c < d && i < 2) || (c < 2 * d && i < 1);  // no such node
          const bool upper = c - rows.kept() > r, multipliers = r < m && c >= rows.kept();
          if (!before && !upper && !multipliers) entry(i, r, c) = random(size);
        }
      }
      for (int k = 0; k < d; ++k) entry(i, m + k, rows.kept() + m + k) += 4.0;
      for (int k = 0; k < m; ++k) entry(i, m + k, rows.kept() + k) += 1.0;
    }
    rows.data = data.data();
  }

  double& entry(int node, int r, int c) { return data[rows.at(node, r) + c]; }
  long size() const { return static_cast<long>(rows.nodes) * rows.width(); }

  // Column-major, both triangles.
  std::vector<long double> dense(double epsilon) const {
    const long n = size(), width = rows.width();
    const int d = rows.primal, m = rows.dual;
    std::vector<long double> a(n * n, 0.0L);
    const auto put = [&](long r, long c, long double value) {
      a[c * n + r] += value;
      if (r != c) a[r * n + c] += value;
    };
    for (int i = 0; i < rows.nodes; ++i) {
      for (int r = 0; r < width; ++r) {
        for (int back = 1; back < 3; ++back)
          for (int c = 0; c < d && i >= back; ++c)
            put(i * width + r, (i - back) * width + m + c, rows.row(i, r)[(2 - back) * d + c]);
        for (int c = 0; c <= r; ++c)
          put(i * width + r, i * width + c, rows.row(i, r)[rows.kept() + c]);
      }
      for (int r = 0; r < m; ++r) put(i * width + r, i * width + r, -epsilon);
      // damping (I + smoothing D2^T D2): row i of D2 is x_i - 2 x_{i-1} + x_{i-2}
      constexpr int kWeights[3] = {1, -2, 1};
      for (int k = 0; k < d; ++k) {
        put(i * width + m + k, i * width + m + k, rows.damping);
        for (int p = 0; p < 3 && p <= i; ++p)
          for (int q = p; q < 3 && q <= i; ++q)
            put((i - p) * width + m + k, (i - q) * width + m + k,
                rows.damping * rows.smoothing * kWeights[p] * kWeights[q]);
      }
    }
    return a;
  }

  NodeRows rows;
  std::vector<double> data;
};

std::vector<double> product(const std::vector<long double>& a, const std::vector<double>& x,
                            int m) {
  const long n = static_cast<long>(x.size()) / m;
  std::vector<double> y(x.size());
  for (int j = 0; j < m; ++j) {
    for (long r = 0; r < n; ++r) {
      long double sum = 0;
      for (long c = 0; c < n; ++c) sum += a[c * n + r] * x[c * m + j];
      y[r * m + j] = static_cast<double>(sum);
    }
  }
  return y;
}

double largest_difference(const std::vector<double>& a, const std::vector<double>& b) {
  double most = 0;
  for (std::size_t i = 0; i < a.size(); ++i) most = std::max(most, std::abs(a[i] - b[i]));
  return most;
}

class Frontal : public testing::TestWithParam<Shape> {
 protected:
  const Matrix matrix_{GetParam()};
  FrontalKkt make(Isa isa = Isa::avx512,
                  linalg::Storage storage = linalg::Storage::automatic) const {
    const Shape s = GetParam();
    return {s.nodes, s.primal, s.dual, isa, storage};
  }
};

TEST_P(Frontal, ResidualIsThatOfTheDenseMatrix) {
  FrontalKkt kkt = make();
  for (int m : {1, 2, 3}) {
    const std::vector<double> x = test::Random(1).vector(matrix_.size() * m);
    const std::vector<double> b = test::Random(2).vector(x.size());
    std::vector<double> expected = product(matrix_.dense(0.0), x, m), r(x.size());
    for (std::size_t i = 0; i < x.size(); ++i) expected[i] = b[i] - expected[i];
    const double most = kkt.residual(matrix_.rows, b.data(), x.data(), r.data(), m, 1);
    EXPECT_LE(largest_difference(r, expected), 1e-12) << m;
    EXPECT_EQ(most, linalg::largest_magnitude(r.data(), matrix_.size(), m, m));
  }
}

TEST_P(Frontal, SolvesTheDenseSystem) {
  FrontalKkt kkt = make();
  kkt.factor(matrix_.rows, kEpsilon, 1);
  for (int m : {1, 2, 3}) {
    const std::vector<double> exact = test::Random(3).vector(matrix_.size() * m);
    std::vector<double> x = product(matrix_.dense(kEpsilon), exact, m);
    kkt.solve(x.data(), m, 1);
    EXPECT_LE(largest_difference(x, exact), 1e-10) << m;
    // epsilon is taken out again
    const std::vector<double> b = product(matrix_.dense(0.0), exact, m);
    x = b;
    kkt.solve(x.data(), m, 1);
    const linalg::Refinement found = kkt.refine(matrix_.rows, b.data(), x.data(), m, 3, 1e-15, 1);
    EXPECT_LE(found.residual, 1e-12);
    EXPECT_LE(largest_difference(x, exact), 1e-10) << m;
  }
}

TEST_P(Frontal, BeginsASolutionWhileItFactors) {
  for (int m : {1, 2, 3}) {
    FrontalKkt kkt = make(), together = make();
    const std::vector<double> b = test::Random(5).vector(matrix_.size() * m);
    std::vector<double> expected = b, x = b;
    kkt.factor(matrix_.rows, kEpsilon, 1);
    kkt.solve(expected.data(), m, 1);
    for (int threads : {1, 2}) {
      x = b;
      together.factor_and_begin(matrix_.rows, kEpsilon, x.data(), m, threads);
      together.finish(x.data(), m, threads);
      EXPECT_EQ(x, expected) << m;
    }
  }
}

// What finish() would take for a first half is another one's: of a solve in between, or used up.
TEST_P(Frontal, OnlyWhatWasBegunIsFinished) {
  FrontalKkt kkt = make();
  std::vector<double> x = test::Random(5).vector(2 * matrix_.size());
  const auto begin = [&] { kkt.factor_and_begin(matrix_.rows, kEpsilon, x.data(), 1, 1); };
  EXPECT_THROW(kkt.finish(x.data(), 1, 1), ArgumentError);
  begin();
  EXPECT_THROW(kkt.finish(x.data(), 2, 1), ArgumentError);
  kkt.finish(x.data(), 1, 1);
  EXPECT_THROW(kkt.finish(x.data(), 1, 1), ArgumentError);
  begin();
  kkt.solve(x.data(), 2, 1);
  EXPECT_THROW(kkt.finish(x.data(), 1, 1), ArgumentError);
  begin();
  kkt.factor(matrix_.rows, kEpsilon, 1);
  EXPECT_THROW(kkt.finish(x.data(), 1, 1), ArgumentError);
}

// A right-hand side's solution and residual do not depend on those beside it.
TEST_P(Frontal, ColumnsAreIndependent) {
  constexpr int m = 3;
  FrontalKkt kkt = make();
  kkt.factor(matrix_.rows, kEpsilon, 1);
  const long rows = matrix_.size();
  const std::vector<double> b = test::Random(6).vector(rows * m);
  std::vector<double> x = b, r(b.size());
  kkt.solve(x.data(), m, 1);
  kkt.residual(matrix_.rows, b.data(), x.data(), r.data(), m, 1);
  for (int j = 0; j < m; ++j) {
    std::vector<double> bj(rows), xj(rows), rj(rows);
    for (long i = 0; i < rows; ++i) bj[i] = xj[i] = b[i * m + j];
    kkt.solve(xj.data(), 1, 1);
    kkt.residual(matrix_.rows, bj.data(), xj.data(), rj.data(), 1, 1);
    for (long i = 0; i < rows; ++i) {
      ASSERT_EQ(xj[i], x[i * m + j]) << i << ' ' << j;
      ASSERT_EQ(rj[i], r[i * m + j]) << i << ' ' << j;
    }
  }
}

// However it is computed: threads, instruction sets, and where records are written.
TEST_P(Frontal, SameBits) {
  const auto solve = [&](FrontalKkt kkt, int threads) {
    kkt.factor(matrix_.rows, kEpsilon, threads);
    const std::vector<double> b = test::Random(4).vector(2 * matrix_.size());
    std::vector<double> x = b;
    kkt.solve(x.data(), 2, threads);
    kkt.refine(matrix_.rows, b.data(), x.data(), 2, 2, 0.0, threads);
    std::vector<double> single(b.begin(), b.begin() + matrix_.size());
    kkt.solve(single.data(), 1, threads);
    x.insert(x.end(), single.begin(), single.end());
    return x;
  };
  const std::vector<double> expected = solve(make(), 1);
  EXPECT_EQ(solve(make(), 2), expected);
  EXPECT_EQ(solve(make(Isa::avx2), 1), expected);
  EXPECT_EQ(solve(make(Isa::portable), 1), expected);
  EXPECT_EQ(solve(make(Isa::avx512, linalg::Storage::streamed), 2), expected);
}

TEST_P(Frontal, ABadPivotIsNamedByNodeAndRow) {
  const Shape s = GetParam();
  const auto failure = [&](const Matrix& m) {
    FrontalKkt kkt = make();
    for (int threads : {1, 2}) {
      try {
        kkt.factor(m.rows, kEpsilon, threads);
        ADD_FAILURE() << "factored";
      } catch (const FactorizationError& error) {
        if (threads == 2) return error;
      }
    }
    return FactorizationError("", -1, -1);
  };
  for (int node : {0, s.nodes / 2, s.nodes - 1}) {
    for (int row : {0, s.primal - 1}) {
      Matrix wrong(s);
      const int r = s.dual + row;
      wrong.entry(node, r, wrong.rows.kept() + r) = -1e6;
      const FactorizationError error = failure(wrong);
      EXPECT_EQ(error.block, node);
      EXPECT_EQ(error.pivot, r);
      EXPECT_NE(std::string(error.what()).find("wrong sign"), std::string::npos) << error.what();
    }
    Matrix unknown(s);
    unknown.entry(node, s.dual, unknown.rows.kept() + s.dual) =
        std::numeric_limits<double>::quiet_NaN();
    EXPECT_NE(std::string(failure(unknown).what()).find("not finite"), std::string::npos);
  }
}

// What a matrix that is not a number left in the memory of a factorization does not reach the next.
TEST_P(Frontal, AFailureLeavesNoTrace) {
  const auto solution = [&](FrontalKkt& kkt) {
    kkt.factor(matrix_.rows, kEpsilon, 1);
    std::vector<double> x = test::Random(5).vector(2 * matrix_.size());
    kkt.solve(x.data(), 2, 1);
    return x;
  };
  FrontalKkt fresh = make(), used = make();
  Matrix unknown(GetParam());
  for (int node : {0, GetParam().nodes - 1}) {
    unknown.entry(node, GetParam().dual, unknown.rows.kept() + GetParam().dual) =
        std::numeric_limits<double>::quiet_NaN();
    EXPECT_THROW(used.factor(unknown.rows, kEpsilon, 1), FactorizationError);
    std::vector<double> x(matrix_.size());
    EXPECT_THROW(used.solve(x.data(), 1, 1), ArgumentError);
    EXPECT_THROW(used.factor_and_begin(unknown.rows, kEpsilon, x.data(), 1, 1), FactorizationError);
    EXPECT_THROW(used.finish(x.data(), 1, 1), ArgumentError);
  }
  EXPECT_EQ(solution(used), solution(fresh));
}

INSTANTIATE_TEST_SUITE_P(Shapes, Frontal,
                         testing::Values(Shape{1, 3, 1}, Shape{2, 3, 1}, Shape{3, 5, 2},
                                         Shape{4, 1, 1}, Shape{5, 9, 0}, Shape{6, 6, 6},
                                         Shape{9, 18, 6}, Shape{12, 38, 6}, Shape{67, 7, 3},
                                         Shape{150, 2, 1}));

}  // namespace
}  // namespace trajopt
