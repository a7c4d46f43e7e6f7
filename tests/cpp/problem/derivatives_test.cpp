// Gradient of the objective and Jacobian of the constraints against finite differences.
#include <gtest/gtest.h>

#include "problem/fixtures.h"

namespace trajopt {
namespace {

class Derivatives : public testing::TestWithParam<test::Named> {};

TEST_P(Derivatives, GradientOfObjective) {
  test::Case c = test::make_case(GetParam().setup);
  Evaluation e;
  Linearization lin;
  c.problem->linearize(c.state, 0.0, e, lin);
  const auto numeric = test::differences(*c.problem, c.state, [&](const State& s) {
    Evaluation at;
    c.problem->evaluate(s, at);
    return std::vector<double>{at.objective};
  });
  ASSERT_EQ(numeric.size(), lin.node_gradient.size());
  const double scale = test::largest(lin.node_gradient);
  for (std::size_t j = 0; j < numeric.size(); ++j)
    ASSERT_NEAR(numeric[j][0], lin.node_gradient[j], 1e-8 * scale) << "unknown " << j;
}

TEST_P(Derivatives, JacobianOfConstraints) {
  test::Case c = test::make_case(GetParam().setup);
  Evaluation e;
  Linearization lin;
  c.problem->linearize(c.state, 0.0, e, lin);
  KktSystem kkt(*c.problem, 0.0, linalg::Ordering::sequential);
  kkt.assemble(lin, 0.0);
  const auto numeric = test::differences(*c.problem, c.state, [&](const State& s) {
    Evaluation at;
    c.problem->evaluate(s, at);
    return at.constraint;
  });
  const double scale = test::largest(numeric);
  std::vector<double> x(kkt.rows(), 0.0), y;
  for (std::size_t j = 0; j < numeric.size(); ++j) {
    x[test::tangent_row(kkt, j)] = 1;
    kkt.multiply(x, y);
    x[test::tangent_row(kkt, j)] = 0;
    for (std::size_t r = 0; r < numeric[j].size(); ++r) {
      ASSERT_NEAR(numeric[j][r], y[test::constraint_row(kkt, r)], 1e-8 * scale)
          << "constraint " << r << ", unknown " << j;
    }
  }
}

// A linearization evaluates the same numbers as a plain evaluation, bit for bit.
TEST_P(Derivatives, EvaluationAgrees) {
  test::Case c = test::make_case(GetParam().setup);
  Evaluation plain, full;
  Linearization lin;
  c.problem->evaluate(c.state, plain);
  c.problem->linearize(c.state, 1e-3, full, lin);
  EXPECT_EQ(plain.objective, full.objective);
  EXPECT_EQ(plain.terms, full.terms);
  EXPECT_EQ(plain.constraint, full.constraint);
  EXPECT_EQ(plain.torque, full.torque);
}

INSTANTIATE_TEST_SUITE_P(Setups, Derivatives, testing::ValuesIn(test::all_setups()),
                         [](const auto& info) { return info.param.name; });

}  // namespace
}  // namespace trajopt
