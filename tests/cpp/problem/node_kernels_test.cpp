// Node kernels of the active instruction set against their bodies, compiled for none: bit for bit.
#include "trajopt/problem/node_kernels.h"

#include <gtest/gtest.h>

#include <cstring>

#include "problem/fixtures.h"

namespace trajopt {
namespace {

void expect_same_bits(const std::vector<double>& actual, const std::vector<double>& expected,
                      const char* what) {
  ASSERT_EQ(actual.size(), expected.size());
  for (std::size_t i = 0; i < actual.size(); ++i)
    ASSERT_EQ(std::memcmp(&actual[i], &expected[i], sizeof(double)), 0) << what << " " << i;
}

class NodeKernels : public testing::TestWithParam<test::Named> {
 protected:
  test::Case c = test::make_case(GetParam().setup);
  const trajopt::NodeKernels& kernels = node_kernels();
  const long n = c.problem->frame_count(), d = c.problem->model().ndof, nq = c.problem->model().nq;
  const ModelView model = view(c.problem->model());
};

TEST_P(NodeKernels, LocalTerms) {
  std::vector<double> frames;
  c.problem->frames_of(c.state, frames);
  const FrameInput in = c.problem->frame_input(frames.data(), 0);
  ASSERT_EQ(c.problem->local_terms().size(), 3u);
  for (const LocalTerm& term : c.problem->local_terms()) {
    std::vector<double> h[2], g[2], cost[3];
    for (int k = 0; k < 2; ++k) {
      h[k].assign(n * 6 * d * d, 0.5);
      g[k].assign(n * 3 * d, 0.5);
    }
    for (auto& v : cost) v.assign(n, 0.0);
    kernels.local_term(in, term, 0, n, h[0].data(), g[0].data(), cost[0].data());
    kernels.local_term(in, term, 0, n, nullptr, nullptr, cost[1].data());
    for (long f = 0; f < n; ++f) {
      cost[2][f] = add_local_term<true>(in.model, term, local_frame(in, f),
                                        h[1].data() + f * 6 * d * d, g[1].data() + f * 3 * d);
    }
    expect_same_bits(h[0], h[1], "hessian");
    expect_same_bits(g[0], g[1], "gradient");
    expect_same_bits(cost[0], cost[2], "cost");
    expect_same_bits(cost[1], cost[2], "cost without derivatives");
  }
}

TEST_P(NodeKernels, Retraction) {
  test::Random random(3);
  const std::vector<double> step = random.vector(n * d, 0.7);
  std::vector<double> frames;
  c.problem->frames_of(c.state, frames);
  std::vector<double> actual(n * nq), expected(n * nq);
  kernels.retract(model, 0, n, frames.data(), step.data(), d, actual.data());
  for (long i = 0; i < n; ++i)
    integrate_body(model, frames.data() + i * nq, step.data() + i * d, expected.data() + i * nq);
  expect_same_bits(actual, expected, "configuration");
}

TEST_P(NodeKernels, Steps) {
  const int nodes = c.problem->nodes(), primal = c.problem->primal(), dual = c.problem->dual();
  const bool ring = c.problem->options().periodic;
  test::Random random(4);
  const std::size_t width = primal + dual, count = nodes;
  const auto gradient = random.vector(count * primal), constraint = random.vector(count * dual);
  std::vector<double> steps[2] = {random.vector(count * width * 2), {}};
  steps[1] = steps[0];
  std::vector<double> items[2], step[2], rhs[2], corrected[2];
  for (int k = 0; k < 2; ++k) {
    items[k].resize(kStepItems * count);
    step[k].resize(count * primal);
    rhs[k].resize(count * width);
    corrected[k].resize(count * primal);
  }
  const auto rows = [&](int k) {
    return StepRows{nodes,          primal, dual, ring, 60.0, gradient.data(), constraint.data(),
                    steps[k].data()};
  };
  kernels.measure_steps(rows(0), 0, nodes, items[0].data(), nodes);
  kernels.compose_step(rows(0), 0, nodes, 0.7, 0.3, step[0].data());
  kernels.write_correction_rhs(rows(0), 0, nodes, 0.3, gradient.data(), rhs[0].data());
  kernels.add_correction(rows(0), 0, nodes, rhs[0].data(), step[0].data(), corrected[0].data());
  kernels.write_steps_rhs(rows(0), 0, nodes);
  for (long i = 0; i < nodes; ++i) {
    measure_steps(rows(1), i, items[1].data(), nodes);
    compose_step(rows(1), i, 0.7, 0.3, step[1].data());
    write_correction_rhs(rows(1), i, 0.3, gradient.data(), rhs[1].data());
    add_correction(rows(1), i, rhs[1].data(), step[1].data(), corrected[1].data());
  }
  for (long i = 0; i < nodes; ++i) write_steps_rhs(rows(1), i);
  expect_same_bits(items[0], items[1], "item");
  expect_same_bits(step[0], step[1], "step");
  expect_same_bits(rhs[0], rhs[1], "right-hand side of a correction");
  expect_same_bits(corrected[0], corrected[1], "corrected step");
  expect_same_bits(steps[0], steps[1], "right-hand sides");
}

// Also by many ranks; in a ring the row that closes it is the border.
TEST_P(NodeKernels, BlockRows) {
  const ProblemOptions& options = c.problem->options();
  if (options.formulation == Formulation::spline) return;
  const int nodes = c.problem->nodes(), primal = c.problem->primal(), dual = c.problem->dual();
  const bool ring = options.periodic;
  const long blocks = (nodes + 1) / 2, size = 2 * (primal + dual), square = size * size;
  test::Random random(5);
  const auto hessian = random.vector(n * 6 * d * d), jacobian = random.vector(n * 3 * dual * d);
  std::vector<double> matrices[2];
  for (std::vector<double>& matrix : matrices) matrix.assign(4 * blocks * square, 0.25);
  const auto rows = [&](int k) {
    double* at = matrices[k].data();
    double* border = ring ? at + 2 * blocks * square : nullptr;
    return KktRows{nodes,
                   primal,
                   dual,
                   ring,
                   60.0,
                   0.1,
                   hessian.data(),
                   jacobian.data(),
                   at,
                   at + blocks * square,
                   border,
                   ring ? border + blocks * square : nullptr};
  };
  for (long g = 0; g < blocks; ++g) {
    kernels.write_block_row(rows(0), g);
    write_block_row(Emulated(24, RankOrder::reverse), rows(1), g);
  }
  expect_same_bits(matrices[0], matrices[1], "matrix");
}

INSTANTIATE_TEST_SUITE_P(Setups, NodeKernels, testing::ValuesIn(test::all_setups()),
                         [](const auto& info) { return info.param.name; });

}  // namespace
}  // namespace trajopt
