#include "trajopt/linalg/block_tridiagonal.h"

#include <gtest/gtest.h>

#include "linalg/random_matrix.h"

namespace trajopt::linalg {
namespace {

TEST(BlockTridiagonal, MatmulIsTheDenseProduct) {
  for (int blocks : {1, 2, 5}) {
    for (int size : {1, 3, 8, 13}) {
      for (int m : {1, 4}) {
        SymmetricBlockTridiagonal a(blocks, size, 2);
        test::fill_random(a, nullptr, 1);
        const long rows = a.rows();
        const std::vector<double> x = test::random_vector(2 * rows * m, 2);
        std::vector<double> y(x.size()), threaded(x.size());
        a.matmul(x.data(), y.data(), m);
        a.matmul(x.data(), threaded.data(), m, 2);
        EXPECT_EQ(y, threaded);
        for (int item = 0; item < 2; ++item) {
          const std::vector<double> full = test::dense(a, item);
          for (long i = 0; i < rows; ++i) {
            for (int j = 0; j < m; ++j) {
              double sum = 0.0;
              for (long k = 0; k < rows; ++k) {
                sum += full[i * rows + k] * x[(item * rows + k) * m + j];
              }
              EXPECT_NEAR(y[(item * rows + i) * m + j], sum, 1e-11 * size * size);
            }
          }
        }
      }
    }
  }
}

TEST(BlockTridiagonal, SetZero) {
  SymmetricBlockTridiagonal a(3, 2);
  test::fill_random(a, nullptr, 1);
  a.set_zero();
  const std::vector<double> x(6, 1.0);
  std::vector<double> y(6, 1.0);
  a.matmul(x.data(), y.data(), 1);
  for (double value : y) EXPECT_EQ(value, 0.0);
}

}  // namespace
}  // namespace trajopt::linalg
