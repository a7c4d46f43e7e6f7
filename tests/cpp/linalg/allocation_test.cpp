// factor(), solve() and refine() run hundreds of times a second: they must not allocate.
#include <gtest/gtest.h>

#include "counting_allocator.h"
#include "linalg/random_matrix.h"
#include "trajopt/linalg/bordered.h"

namespace trajopt::linalg {
namespace {

TEST(Allocation, NoneAfterConstruction) {
  SymmetricBlockTridiagonal a(20, 24);
  test::fill_random(a, nullptr, 1);
  std::vector<double> rhs = test::random_vector(a.rows(), 2), x = rhs;
  std::vector<double> e(a.rows() * 2, 0.1), f = {50.0, 0.0, 0.0, 50.0}, g = {1.0, 2.0}, y = g;
  for (Ordering ordering : {Ordering::sequential, Ordering::cyclic, Ordering::chunked}) {
    Factorization factorization(20, 24, ordering);
    BorderedFactorization bordered(20, 24, 2, ordering);
    const long before = trajopt::test::allocations;
    factorization.factor(a, nullptr, 1e-6, 2);
    factorization.solve(x.data(), 1, 2);
    factorization.refine(a, rhs.data(), x.data(), 1, 3, 1e-15, 2);
    bordered.factor(a, e.data(), f.data(), nullptr, nullptr, 0.0, 2);
    bordered.solve(x.data(), y.data(), 1, 2);
    bordered.refine(a, f.data(), rhs.data(), g.data(), x.data(), y.data(), 3, 1e-15, 2);
    EXPECT_EQ(trajopt::test::allocations - before, 0) << ordering_name(ordering);
  }
}

}  // namespace
}  // namespace trajopt::linalg
