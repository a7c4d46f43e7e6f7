// The KKT matrix against assemblies that share nothing with it, its steps against a dense solver.
#include "trajopt/problem/kkt_system.h"

#include <gtest/gtest.h>

#include <array>
#include <utility>

#include "problem/fixtures.h"
#include "solver/flight.h"
#include "solver/functions.h"
#include "trajopt/base/error.h"
#include "trajopt/problem/node_kernels.h"

namespace trajopt {
namespace {

using linalg::Ordering;
using Columns = std::vector<std::vector<double>>;

struct Linearized {
  test::Case c;
  Evaluation e;
  Linearization lin;
};

// In the form that an ordering asks for.
Linearized linearize(test::Case c, double augmentation = 0,
                     Ordering ordering = Ordering::sequential) {
  Linearized l{std::move(c), {}, {}};
  l.lin.by_nodes = ordering == Ordering::frontal;
  l.c.problem->linearize(l.c.state, augmentation, l.e, l.lin);
  return l;
}

std::vector<Ordering> orderings(const test::Setup& setup) {
  std::vector<Ordering> all = {Ordering::sequential, Ordering::cyclic, Ordering::chunked};
  if (KktSystem::frontal_possible(*test::make_case(setup).problem))
    all.push_back(Ordering::frontal);
  return all;
}

// Gaussian elimination with partial pivoting in long double; m = b.size() right-hand sides.
Columns dense_solve(const Columns& a, const Columns& b) {
  const std::size_t n = a.size();
  std::vector<std::vector<long double>> rows(n, std::vector<long double>(n + b.size()));
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < n; ++j) rows[i][j] = a[j][i];
    for (std::size_t k = 0; k < b.size(); ++k) rows[i][n + k] = b[k][i];
  }
  for (std::size_t k = 0; k < n; ++k) {
    std::size_t best = k;
    for (std::size_t i = k + 1; i < n; ++i)
      if (std::abs(rows[i][k]) > std::abs(rows[best][k])) best = i;
    std::swap(rows[k], rows[best]);
    for (std::size_t i = k + 1; i < n; ++i) {
      const long double f = rows[i][k] / rows[k][k];
      if (f == 0) continue;
      for (std::size_t j = k; j < n + b.size(); ++j) rows[i][j] -= f * rows[k][j];
    }
  }
  Columns x(b.size(), std::vector<double>(n));
  for (std::size_t c = 0; c < b.size(); ++c) {
    std::vector<long double> y(n);
    for (std::size_t i = n; i-- > 0;) {
      y[i] = rows[i][n + c];
      for (std::size_t j = i + 1; j < n; ++j) y[i] -= rows[i][j] * y[j];
      y[i] /= rows[i][i];
      x[c][i] = static_cast<double>(y[i]);
    }
  }
  return x;
}

template <class Call>
std::string refusal(const Call& call) {
  try {
    call();
  } catch (const ArgumentError& error) {
    return error.what();
  }
  return "";
}

// A linearization in the form of another ordering would be read beyond its end.
TEST(KktForm, ALinearizationInAnotherFormIsRefused) {
  const Linearized blocks = linearize(test::make_flight(Formulation::frames));
  const Linearized nodes = linearize(test::make_flight(Formulation::frames), 0, Ordering::frontal);
  KktSystem frontal(*nodes.c.problem, 60.0, Ordering::frontal);
  KktSystem cyclic(*blocks.c.problem, 60.0, Ordering::cyclic);
  Linearization none;
  none.by_nodes = true;
  EXPECT_EQ(refusal([&] { frontal.assemble(nodes.lin, 0.1); }), "");
  EXPECT_EQ(refusal([&] { cyclic.assemble(blocks.lin, 0.1); }), "");
  const std::pair<std::string, std::string> wrong[] = {
      {refusal([&] { frontal.assemble(blocks.lin, 0.1); }), "by_nodes = false"},
      {refusal([&] { cyclic.assemble(nodes.lin, 0.1); }), "by_nodes = true"},
      {refusal([&] { frontal.assemble(nodes.lin, 0.1, true); }), "identity = true"},
      {refusal([&] { frontal.assemble(none, 0.1); }), "node_rows holds 0 numbers"},
  };
  for (const auto& [message, words] : wrong) EXPECT_EQ(message.find(words), 0u) << message;
}

class Kkt : public testing::TestWithParam<test::Named> {};

// Symmetric, nothing between multipliers, the identity where the last block is padding.
TEST_P(Kkt, Structure) {
  const Linearized l = linearize(test::make_case(GetParam().setup));
  KktSystem kkt(*l.c.problem, 60.0, Ordering::sequential);
  kkt.assemble(l.lin, 0.1);
  const Columns k = test::dense(kkt);
  const double scale = test::largest(k);
  const long used = kkt.offset(kkt.nodes());
  for (long i = 0; i < kkt.rows(); ++i) {
    for (long j = 0; j <= i; ++j) {
      EXPECT_NEAR(k[i][j], k[j][i], 1e-15 * scale) << i << ", " << j;
      const int nb = kkt.primal() + kkt.dual();
      const bool multipliers = i % nb < kkt.dual() && j % nb < kkt.dual();
      if (i >= used) {
        EXPECT_EQ(k[j][i], i == j ? 1.0 : 0.0);
      } else if (multipliers) {
        EXPECT_EQ(k[j][i], 0.0);
      }
    }
  }
}

// Residuals linear in the unknowns: H is the derivative of the gradient.
TEST_P(Kkt, HessianOfQuadraticTerms) {
  test::Setup setup = GetParam().setup;
  setup.balls = false;
  test::Random random(2);
  const Model model = test::make_character(false);
  const Objective objective = test::quadratic_terms(model, setup.frames, random);
  const Linearized l = linearize(test::make_case(setup, model, objective, random));
  KktSystem kkt(*l.c.problem, 0.0, Ordering::sequential);
  kkt.assemble(l.lin, 0.0);
  const Columns k = test::dense(kkt);
  Evaluation e;
  Linearization lin;
  const Columns numeric = test::differences(*l.c.problem, l.c.state, [&](const State& s) {
    l.c.problem->linearize(s, 0.0, e, lin);
    return lin.node_gradient;
  });
  const double scale = test::largest(numeric);
  for (std::size_t j = 0; j < numeric.size(); ++j) {
    for (std::size_t i = 0; i < numeric.size(); ++i) {
      ASSERT_NEAR(numeric[j][i], k[test::tangent_row(kkt, j)][test::tangent_row(kkt, i)],
                  1e-9 * scale)
          << i << ", " << j;
    }
  }
}

// Effort: H = 2 w J^T J with J from finite differences of the torques. The augmentation adds the
// same for the unactuated rows of every frame.
TEST_P(Kkt, HessianOfEffort) {
  test::Random random(3);
  const Model model = test::make_character();
  const double weight = 0.7, augmentation = 0.3;
  const int frames = GetParam().setup.frames;
  const Linearized l =
      linearize(test::make_case(GetParam().setup, model, test::effort_only(frames, weight), random),
                augmentation);
  KktSystem kkt(*l.c.problem, 0.0, Ordering::sequential);
  kkt.assemble(l.lin, 0.0);
  const Columns k = test::dense(kkt);
  Evaluation e;
  const auto gram_of = [&](const auto& rows) {
    const Columns j = test::differences(*l.c.problem, l.c.state, [&](const State& s) {
      l.c.problem->evaluate(s, e);
      return rows(e);
    });
    Columns gram(j.size(), std::vector<double>(j.size(), 0.0));
    for (std::size_t a = 0; a < j.size(); ++a)
      for (std::size_t b = 0; b < j.size(); ++b)
        for (std::size_t r = 0; r < j[a].size(); ++r) gram[a][b] += j[a][r] * j[b][r];
    return gram;
  };
  const Columns torque = gram_of([](const Evaluation& at) { return at.torque; });
  const Columns physics = gram_of([](const Evaluation& at) { return at.frame_constraint; });
  const double scale = 2 * weight * test::largest(torque) + augmentation * test::largest(physics);
  for (std::size_t a = 0; a < torque.size(); ++a) {
    for (std::size_t b = 0; b < torque.size(); ++b) {
      ASSERT_NEAR(2 * weight * torque[a][b] + augmentation * physics[a][b],
                  k[test::tangent_row(kkt, a)][test::tangent_row(kkt, b)], 1e-8 * scale)
          << a << ", " << b;
    }
  }
}

// t.W t, t.W n and n.W n of two random steps.
std::array<double, 3> metric(const KktSystem& kkt, const Linearized& l,
                             const std::vector<double>& t, const std::vector<double>& n) {
  std::vector<double> steps;
  for (std::size_t i = 0; i < t.size(); ++i) steps.insert(steps.end(), {t[i], n[i]});
  std::vector<double> items(static_cast<std::size_t>(kStepItems) * kkt.nodes());
  const StepRows rows =
      kkt.step_rows(l.lin.node_gradient.data(), l.e.constraint.data(), steps.data());
  node_kernels().measure_steps(rows, 0, kkt.nodes(), items.data(), kkt.nodes());
  std::array<double, 3> sums;
  for (int k = 0; k < 3; ++k) sums[k] = folded<Sum>(items.data() + k * kkt.nodes(), kkt.nodes());
  return sums;
}

// The trust-region metric: what damping multiplies, and what measure_steps() measures.
TEST_P(Kkt, Metric) {
  const Linearized l = linearize(test::make_case(GetParam().setup));
  for (double smoothing : {0.0, 60.0}) {
    KktSystem kkt(*l.c.problem, smoothing, Ordering::sequential);
    test::Random random(4);
    std::vector<double> x(kkt.rows(), 0.0), y(x), with, without;
    for (std::size_t j = 0; j < l.lin.node_gradient.size(); ++j) {
      x[test::tangent_row(kkt, j)] = random();
      y[test::tangent_row(kkt, j)] = random();
    }
    kkt.assemble(l.lin, 1e6);
    kkt.multiply(x, with);
    kkt.assemble(l.lin, 0.0);
    kkt.multiply(x, without);
    double quadratic = 0, mixed = 0, plain = 0;
    for (long i = 0; i < kkt.rows(); ++i) {
      quadratic += 1e-6 * x[i] * (with[i] - without[i]);
      mixed += 1e-6 * y[i] * (with[i] - without[i]);
      plain += x[i] * x[i];
    }
    const auto [xx, xy, yy] = metric(kkt, l, x, y);
    EXPECT_NEAR(xx, quadratic, 1e-8 * quadratic);
    EXPECT_NEAR(xy, mixed, 1e-8 * quadratic);
    EXPECT_EQ(yy, metric(kkt, l, y, x)[0]);
    if (smoothing == 0) {
      EXPECT_NEAR(xx, plain, 1e-12 * plain);
    }
  }
}

TEST_P(Kkt, StepsOfAllOrderings) {
  const auto norm = [](const std::vector<double>& v) {
    double sum = 0;
    for (double value : v) sum += value * value;
    return std::sqrt(sum);
  };
  double worst = 0;
  for (bool identity : {false, true}) {
    for (Ordering ordering : orderings(GetParam().setup)) {
      if (identity && ordering == Ordering::frontal) continue;  // it has no such form
      const Linearized l = linearize(test::make_case(GetParam().setup), 1e-3, ordering);
      KktSystem kkt(*l.c.problem, 60.0, ordering);
      kkt.assemble(l.lin, 1e-2, identity);
      const Columns k = test::dense(kkt);
      test::Random random(5);
      Columns b{random.vector(kkt.rows()), random.vector(kkt.rows())};
      const Columns exact = dense_solve(k, b);
      std::vector<double> rhs(2 * kkt.rows());
      for (long i = 0; i < kkt.rows(); ++i)
        for (int c = 0; c < 2; ++c) rhs[2 * i + c] = b[c][i];
      kkt.factor(1e-10);
      kkt.solve(rhs, 2);
      for (int c = 0; c < 2; ++c) {
        // Variables and multipliers each by themselves: their sizes differ.
        std::vector<double> error[2], whole[2];
        for (long i = 0; i < kkt.rows(); ++i) {
          const bool multiplier = i % (kkt.primal() + kkt.dual()) < kkt.dual();
          error[multiplier].push_back(rhs[2 * i + c] - exact[c][i]);
          whole[multiplier].push_back(exact[c][i]);
        }
        const double relative =
            std::max(norm(error[0]) / norm(whole[0]), norm(error[1]) / norm(whole[1]));
        EXPECT_LE(relative, 1e-9) << linalg::ordering_name(ordering)
                                  << (identity ? ", identity" : "");
        worst = std::max(worst, relative);
      }
    }
  }
  RecordProperty("relative_error", testing::PrintToString(worst));
}

TEST_P(Kkt, SameBitsForAnyThreadCount) {
  for (Ordering ordering : orderings(GetParam().setup)) {
    std::vector<double> solutions[2];
    for (int threads : {1, 2}) {
      test::Setup setup = GetParam().setup;
      setup.threads = threads;
      const Linearized l = linearize(test::make_case(setup), 1e-3, ordering);
      KktSystem kkt(*l.c.problem, 60.0, ordering);
      kkt.assemble(l.lin, 1e-2);
      kkt.factor(1e-10);
      std::vector<double>& x = solutions[threads - 1];
      x = test::Random(6).vector(2 * kkt.rows());
      kkt.solve(x, 2);
      std::vector<double> first(x.begin(), x.begin() + kkt.rows()), product;
      kkt.multiply(first, product);
      x.insert(x.end(), product.begin(), product.end());
      x.insert(x.end(), l.lin.node_gradient.begin(), l.lin.node_gradient.end());
      x.push_back(l.e.objective);
    }
    EXPECT_EQ(solutions[0], solutions[1]) << linalg::ordering_name(ordering);
  }
}

// The matrix by nodes is the matrix by blocks, also across the chunks in which frames are worked
// on.
TEST(KktByNodes, IsTheMatrixByBlocks) {
  for (int frames : {1, 2, 3, 15, 16, 17, 18, 33, 64}) {
    for (int threads : {1, 2}) {
      const test::Setup setup{.frames = frames, .uneven = true, .threads = threads};
      const Linearized blocks = linearize(test::make_case_with_functions(setup), 1e-3);
      const Linearized nodes =
          linearize(test::make_case_with_functions(setup), 1e-3, Ordering::frontal);
      EXPECT_EQ(nodes.e.objective, blocks.e.objective);
      EXPECT_EQ(nodes.lin.node_gradient, blocks.lin.node_gradient);
      KktSystem by_blocks(*blocks.c.problem, 60.0, Ordering::sequential);
      KktSystem by_nodes(*nodes.c.problem, 60.0, Ordering::frontal);
      by_blocks.assemble(blocks.lin, 0.3);
      by_nodes.assemble(nodes.lin, 0.3);
      const std::vector<double> x = test::Random(7).vector(by_blocks.rows());
      std::vector<double> expected, actual;
      by_blocks.multiply(x, expected);
      by_nodes.multiply(x, actual);
      double scale = 0;
      for (double value : expected) scale = std::max(scale, std::abs(value));
      ASSERT_EQ(actual.size(), expected.size());
      for (std::size_t i = 0; i < expected.size(); ++i)
        ASSERT_NEAR(actual[i], expected[i], 1e-14 * scale) << frames << " frames, row " << i;
    }
  }
}

TEST(KktByNodes, IsRefusedWhereItIsNotPossible) {
  for (const test::Setup& setup :
       {test::Setup{.formulation = Formulation::spline}, test::Setup{.periodic = true}}) {
    const test::Case c = test::make_case(setup);
    EXPECT_THROW(KktSystem(*c.problem, 60.0, Ordering::frontal), ArgumentError);
  }
}

TEST(KktByNodes, IsWhatAFrontalSystemAsksFor) {
  const Linearized blocks = linearize(test::make_case({}));
  const Linearized nodes = linearize(test::make_case({}), 0, Ordering::frontal);
  KktSystem kkt(*nodes.c.problem, 60.0, Ordering::frontal);
  EXPECT_THROW(kkt.assemble(blocks.lin, 0.3), ArgumentError);
  EXPECT_THROW(kkt.assemble(nodes.lin, 0.3, true), ArgumentError);
  EXPECT_NO_THROW(kkt.assemble(nodes.lin, 0.3));
}

INSTANTIATE_TEST_SUITE_P(Setups, Kkt, testing::ValuesIn(test::all_setups()),
                         [](const auto& info) { return info.param.name; });

}  // namespace
}  // namespace trajopt
