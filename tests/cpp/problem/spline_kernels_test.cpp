// Spline kernels of the active instruction set against their bodies, compiled for none, and block
// rows by groups of any size: bit for bit.
#include "trajopt/problem/spline_kernels.h"

#include <gtest/gtest.h>

#include <cstring>
#include <limits>

#include "problem/fixtures.h"

namespace trajopt {
namespace {

void expect_same_bits(const std::vector<double>& actual, const std::vector<double>& expected,
                      const char* what) {
  ASSERT_EQ(actual.size(), expected.size());
  for (std::size_t i = 0; i < actual.size(); ++i)
    ASSERT_EQ(std::memcmp(&actual[i], &expected[i], sizeof(double)), 0) << what << " " << i;
}

std::vector<test::Named> splines() {
  std::vector<test::Named> all;
  for (const test::Named& named : test::all_setups())
    if (named.setup.formulation == Formulation::spline) all.push_back(named);
  return all;
}

class SplineKernels : public testing::TestWithParam<test::Named> {
 protected:
  SplineKernels() { c.problem->linearize(c.state, 1e-3, at, lin); }

  test::Case c = test::make_case(GetParam().setup);
  Evaluation at;
  Linearization lin;
  const trajopt::SplineKernels& kernels = spline_kernels();
  const Model& model = c.problem->model();
  const SplineView spline = c.problem->spline().view();
  const int nodes = c.problem->nodes(), primal = c.problem->primal(), dual = c.problem->dual();
};

TEST_P(SplineKernels, ControlPoints) {
  test::Random random(3);
  const auto step = random.vector(static_cast<std::size_t>(nodes) * primal, 0.7);
  std::vector<double> state[2] = {c.state, c.state}, gradient[2], constraint[2];
  for (int k = 0; k < 2; ++k) {
    gradient[k].resize(step.size());
    constraint[k].resize(static_cast<std::size_t>(nodes) * dual);
  }
  for (long z = 0; z < nodes; ++z) {
    kernels.retract(view(model), spline, c.state.data(), step.data(), z, state[0].data());
    kernels.reduce_gradient(spline, primal / 2, lin.frame_gradient.data(), z, gradient[0].data());
    kernels.reduce_constraint(spline, dual / 2, at.frame_constraint.data(), z,
                              constraint[0].data());
    retract_control_point(view(model), spline, c.state.data(), step.data(), z, state[1].data());
    reduce_gradient(spline, primal / 2, lin.frame_gradient.data(), z,
                    gradient[1].data() + z * primal);
    reduce_constraint(spline, dual / 2, at.frame_constraint.data(), z,
                      constraint[1].data() + z * dual);
  }
  expect_same_bits(state[0], state[1], "state");
  expect_same_bits(gradient[0], gradient[1], "gradient");
  expect_same_bits(constraint[0], constraint[1], "constraint");
}

TEST_P(SplineKernels, BlockRows) {
  const long blocks = (nodes + 1) / 2, size = 2L * (primal + dual);
  // Diagonal and lower blocks, which the rows have to write all of.
  const auto matrix = [&](const auto& write) {
    std::vector<double> values((2 * blocks - 1) * size * size,
                               std::numeric_limits<double>::quiet_NaN());
    std::vector<double> scratch(spline_row_scratch(model.ndof));
    const SplineRows rows{spline,
                          model.ndof,
                          dual / 2,
                          0.1,
                          lin.hessian.data(),
                          lin.jacobian.data(),
                          values.data(),
                          values.data() + blocks * size * size};
    for (long g = 0; g < blocks; ++g) write(rows, g, scratch.data());
    return values;
  };
  const auto by = [](const auto& group) {
    return [&](const SplineRows& rows, long g, double* scratch) {
      write_spline_block_row(group, rows, g, scratch);
    };
  };
  const std::vector<double> expected = matrix(by(Serial{}));
  for (double value : expected) ASSERT_EQ(value, value);
  expect_same_bits(matrix(kernels.write_block_row), expected, "kernel's entry");
  for (RankOrder order : {RankOrder::forward, RankOrder::reverse}) {
    for (int ranks : {7, 256})
      expect_same_bits(matrix(by(Emulated(ranks, order))), expected, "group's entry");
  }
}

INSTANTIATE_TEST_SUITE_P(Setups, SplineKernels, testing::ValuesIn(splines()),
                         [](const auto& info) { return info.param.name; });

}  // namespace
}  // namespace trajopt
