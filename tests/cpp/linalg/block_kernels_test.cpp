// Every kernel of every instruction set against its definition, bit for bit.
#include "trajopt/linalg/block_kernels.h"

#include <gtest/gtest.h>

#include <cstring>
#include <string>
#include <tuple>

#include "linalg/random_matrix.h"
#include "linalg/reference.h"
#include "trajopt/linalg/block_buffer.h"

namespace trajopt::linalg {
namespace {

template <class T>
using Matrix = reference::MatrixOf<T>;

// A matrix in the layout the kernels work on: padded rows, spare memory behind the end.
template <class T>
class Padded {
 public:
  Padded(int rows, int columns, const Matrix<T>& from = {})
      : rows_(rows),
        columns_(columns),
        ld_(padded<T>(columns)),
        buffer_(rows * padded<T>(columns)) {
    for (int i = 0; i < rows && !from.empty(); ++i) {
      std::copy_n(from.data() + i * columns, columns, data() + i * ld_);
    }
  }
  T* data() const { return buffer_.data(); }
  long ld() const { return ld_; }
  Matrix<T> matrix() const {
    Matrix<T> m;
    for (int i = 0; i < rows_; ++i)
      m.insert(m.end(), data() + i * ld_, data() + i * ld_ + columns_);
    return m;
  }

 private:
  int rows_, columns_;
  long ld_;
  BasicBlockBuffer<T> buffer_;
};

template <class T>
void expect_same_bits(const Matrix<T>& actual, const Matrix<T>& expected, const char* what) {
  ASSERT_EQ(actual.size(), expected.size());
  for (std::size_t i = 0; i < actual.size(); ++i) {
    ASSERT_EQ(std::memcmp(&actual[i], &expected[i], sizeof(T)), 0)
        << what << " element " << i << ": " << actual[i] << " instead of " << expected[i];
  }
}

template <class T>
Matrix<T> lower_triangle(Matrix<T> m, int size, bool strict) {
  for (int i = 0; i < size; ++i) {
    for (int j = i + (strict ? 0 : 1); j < size; ++j) m[i * size + j] = 0;
  }
  return m;
}

// The strict lower triangle of W, from and to where it is kept.
template <class T>
Matrix<T> unpacked(const BasicBlockBuffer<T>& packed, int size) {
  Matrix<T> m(static_cast<std::size_t>(size) * size);
  for (int i = 0; i < size; ++i) {
    for (int j = 0; j < i; ++j) m[i * size + j] = packed.data()[PackedTriangle<T>::at(size, i, j)];
  }
  return m;
}

template <class T>
BasicBlockBuffer<T> pack(const Matrix<T>& m, int size) {
  BasicBlockBuffer<T> packed(PackedTriangle<T>::length(size));
  for (int i = 0; i < size; ++i) {
    for (int j = 0; j < i; ++j) packed.data()[PackedTriangle<T>::at(size, i, j)] = m[i * size + j];
  }
  return packed;
}

class BlockKernelsTest : public testing::TestWithParam<std::tuple<Isa, int>> {
 protected:
  void SetUp() override {
    if (active_isa() < std::get<0>(GetParam())) GTEST_SKIP() << "not on this machine";
  }
  template <class T>
  const BasicBlockKernels<T>& kernels() const {
    return block_kernels<T>(std::get<0>(GetParam()));
  }
  int size() const { return std::get<1>(GetParam()); }
  template <class T>
  Matrix<T> random(int rows, int columns, unsigned seed) const {
    const auto values = test::random_vector(static_cast<std::size_t>(rows) * columns, seed);
    return Matrix<T>(values.begin(), values.end());
  }

  template <class T>
  void eliminate() const;
  template <class T>
  void update() const;
  template <class T>
  void transpose() const;
  template <class T>
  void vectors() const;
  template <class T>
  void rectangular_products() const;
};

template <class T>
void BlockKernelsTest::eliminate() const {
  const int n = size();
  const auto signs = test::mixed_signs(n, n);
  Matrix<T> a = random<T>(n, n, 1);
  for (int i = 0; i < n; ++i) a[i * n + i] = signs[i] * (T(4) * n + 1 + a[i * n + i] * T(0.1));
  const Matrix<T> start = a;
  const std::vector<double> original(a.begin(), a.end());
  const Padded<T> u(n, n, a), left(n, n, random<T>(n, n, 2)), right(n, n, random<T>(n, n, 3));
  const BasicBlockBuffer<T> w(PackedTriangle<T>::length(n));
  const Padded<T> v_left(n, n), v_right(n, n), u_left(n, n), u_right(n, n);
  Matrix<T> inverse(n);
  BasicElimination<T> e;
  e.size = n;
  e.ld = u.ld();
  e.diagonal = e.u = u.data();
  e.diagonal_ld = u.ld();
  e.original = original.data();
  e.original_step = n + 1;
  e.signs = signs.data();
  e.regularization = 0.25;
  e.w = w.data();
  e.inverse = inverse.data();
  e.left = {n, left.data(), left.ld(), v_left.data(), u_left.data()};
  e.right = {n, right.data(), right.ld(), v_right.data(), u_right.data()};
  ASSERT_EQ(kernels<T>().eliminate(e).row, -1);

  std::vector<Matrix<T>> s = {left.matrix(), right.matrix()}, unscaled;
  Matrix<T> expected_inverse(n);
  reference::eliminate(n, a, expected_inverse, s, unscaled, signs.data(), T(0.25));
  expect_same_bits(inverse, expected_inverse, "inverse");
  expect_same_bits(unpacked(w, n), lower_triangle(a, n, true), "W");
  expect_same_bits(v_left.matrix(), s[0], "left V");
  expect_same_bits(v_right.matrix(), s[1], "right V");
  expect_same_bits(u_left.matrix(), unscaled[0], "left U");
  expect_same_bits(u_right.matrix(), unscaled[1], "right U");

  // Fewer columns of a coupling: the same bits in those.
  const int columns = (n + 1) / 2;
  const Padded<T> again(n, n, start), v(n, n), unscaled_v(n, n);
  e.diagonal = again.data();
  e.left = {columns, left.data(), left.ld(), v.data(), unscaled_v.data()};
  e.right = {};
  ASSERT_EQ(kernels<T>().eliminate(e).row, -1);
  const auto first_columns = [&](const Matrix<T>& m) {
    Matrix<T> part;
    for (int r = 0; r < n; ++r)
      part.insert(part.end(), m.begin() + r * n, m.begin() + r * n + columns);
    return part;
  };
  expect_same_bits(first_columns(v.matrix()), first_columns(s[0]), "columns of V");
  expect_same_bits(first_columns(unscaled_v.matrix()), first_columns(unscaled[0]), "columns of U");
}

template <class T>
void BlockKernelsTest::update() const {
  const int n = size();
  const Matrix<T> source = random<T>(n, n, 4);
  const Padded<T> v(n, n, random<T>(n, n, 5)), u(n, n, random<T>(n, n, 6)), from(n, n, source);
  Matrix<T> expected;
  reference::update(n, source, expected, v.matrix(), u.matrix());
  const Padded<T> whole(n, n), lower(n, n), negative(n, n);
  kernels<T>().update(n, n, n, from.data(), from.ld(), whole.data(), whole.ld(), v.data(), v.ld(),
                      u.data(), u.ld(), false);
  expect_same_bits(whole.matrix(), expected, "whole");
  kernels<T>().update(n, n, n, from.data(), from.ld(), lower.data(), lower.ld(), v.data(), v.ld(),
                      u.data(), u.ld(), true);
  expect_same_bits(lower_triangle(lower.matrix(), n, false), lower_triangle(expected, n, false),
                   "lower");
  reference::update(n, Matrix<T>(source.size(), 0), expected, v.matrix(), u.matrix());
  kernels<T>().update(n, n, n, nullptr, 0, negative.data(), negative.ld(), v.data(), v.ld(),
                      u.data(), u.ld(), false);
  expect_same_bits(negative.matrix(), expected, "from zero");
}

template <class T>
void BlockKernelsTest::transpose() const {
  const int n = size();
  const Matrix<T> source = random<T>(n, n, 7);
  const Padded<T> from(n, n, source), to(n, n);
  kernels<T>().transpose(n, from.data(), from.ld(), to.data(), to.ld());
  Matrix<T> expected(source.size());
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) expected[j * n + i] = source[i * n + j];
  }
  expect_same_bits(to.matrix(), expected, "transpose");
}

template <class T>
void BlockKernelsTest::vectors() const {
  const int n = size();
  const Padded<T> w(n, n, random<T>(n, n, 8));
  const Matrix<T> matrix = w.matrix();
  const BasicBlockBuffer<T> packed = pack(matrix, n);
  for (int m : {1, 2, 5, 8, 17, 25}) {
    if (n > 100 && m > 5) continue;
    const Matrix<T> x = random<T>(n, m, 9), start = random<T>(n, m, 10);
    Matrix<T> actual = start, expected = start;
    kernels<T>().subtract(n, n, w.data(), w.ld(), x.data(), actual.data(), m, m, m, 0);
    reference::subtract(n, n, matrix, x, expected, m);
    expect_same_bits(actual, expected, "subtract");

    actual = expected = start;
    kernels<T>().subtract_transposed(n, n, w.data(), w.ld(), x.data(), actual.data(), m, m, m, 0);
    reference::subtract_transposed(n, n, matrix, x, expected, m);
    expect_same_bits(actual, expected, "subtract_transposed");

    actual = expected = start;
    kernels<T>().subtract_symmetric(n, w.data(), w.ld(), x.data(), actual.data(), m, m, m, 0);
    reference::subtract_symmetric(n, matrix, x, expected, m);
    expect_same_bits(actual, expected, "subtract_symmetric");

    actual = expected = start;
    kernels<T>().substitute(n, packed.data(), actual.data(), m, m, 0);
    reference::substitute(n, matrix, expected, m);
    expect_same_bits(actual, expected, "substitute");

    actual = expected = start;
    kernels<T>().substitute_transposed(n, packed.data(), actual.data(), m, m, 0);
    reference::substitute_transposed(n, matrix, expected, m);
    expect_same_bits(actual, expected, "substitute_transposed");

    actual = expected = start;
    kernels<T>().scale(n, w.data(), actual.data(), m);
    reference::scale(n, matrix, expected, m);
    expect_same_bits(actual, expected, "scale");
  }
}

template <class T>
void BlockKernelsTest::rectangular_products() const {
  const int rows = size(), columns = size() / 2 + 1;
  const Padded<T> v(rows, columns, random<T>(rows, columns, 11));
  for (int m : {1, 2, 3}) {
    Matrix<T> y = random<T>(rows, m, 12), x = random<T>(columns, m, 13), expected = y;
    kernels<T>().subtract(rows, columns, v.data(), v.ld(), x.data(), y.data(), m, m, m, 0);
    reference::subtract(rows, columns, v.matrix(), x, expected, m);
    expect_same_bits(y, expected, "subtract");
    expected = x;
    kernels<T>().subtract_transposed(rows, columns, v.data(), v.ld(), y.data(), x.data(), m, m, m,
                                     0);
    reference::subtract_transposed(rows, columns, v.matrix(), y, expected, m);
    expect_same_bits(x, expected, "subtract_transposed");
  }
}

TEST_P(BlockKernelsTest, Eliminate) {
  eliminate<double>();
  eliminate<float>();
}

TEST_P(BlockKernelsTest, Update) {
  update<double>();
  update<float>();
}

TEST_P(BlockKernelsTest, Transpose) {
  transpose<double>();
  transpose<float>();
}

TEST_P(BlockKernelsTest, Vectors) {
  vectors<double>();
  vectors<float>();
}

TEST_P(BlockKernelsTest, RectangularProducts) {
  rectangular_products<double>();
  rectangular_products<float>();
}

INSTANTIATE_TEST_SUITE_P(Sizes, BlockKernelsTest,
                         testing::Combine(testing::Values(Isa::portable, Isa::avx2, Isa::avx512),
                                          testing::Values(1, 2, 3, 4, 5, 7, 8, 9, 10, 11, 12, 13,
                                                          15, 16, 17, 23, 24, 25, 31, 32, 40, 48,
                                                          64, 63, 65, 82, 96, 130, 200, 255, 256)),
                         [](const auto& info) {
                           return std::string(isa_name(std::get<0>(info.param))) + "_" +
                                  std::to_string(std::get<1>(info.param));
                         });

}  // namespace
}  // namespace trajopt::linalg
