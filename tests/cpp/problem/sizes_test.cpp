// What does not fit is refused before a kernel reads beyond its end.
#include <gtest/gtest.h>

#include <functional>

#include "problem/fixtures.h"
#include "trajopt/base/error.h"

namespace trajopt {
namespace {

constexpr int kFrames = 10;

struct Parts {
  Model model = test::make_character();
  std::vector<double> dt = std::vector<double>(kFrames + 1, 0.1);
  Objective objective;
  std::vector<double> initial, velocity;
  ProblemOptions options;

  Parts() {
    test::Random random(1);
    objective = test::every_term(model, kFrames, random);
    initial.resize(2 * static_cast<std::size_t>(model.nq));
    velocity.resize(model.ndof);
  }
  TrajectoryProblem make() const {
    return {model,  test::make_physics(Integrator::implicit), dt, objective, initial, velocity,
            options};
  }
};

// The message of a problem that `change` makes impossible.
std::string refusal(const std::function<void(Parts&)>& change) {
  Parts parts;
  change(parts);
  try {
    parts.make();
  } catch (const ArgumentError& error) {
    return error.what();
  }
  return "none";
}

TEST(Sizes, OfAProblemsArrays) {
  EXPECT_NO_THROW(Parts().make());
  EXPECT_EQ(refusal([](Parts& p) { p.dt.clear(); }),
            "dt holds 0 steps, expected at least 2: one before the first frame");
  EXPECT_EQ(refusal([](Parts& p) { p.initial.pop_back(); }),
            "initial holds 25 numbers, expected 26");
  EXPECT_EQ(refusal([](Parts& p) { p.velocity.clear(); }), "velocity holds 0 numbers, expected 11");
  EXPECT_EQ(refusal([](Parts& p) { p.objective.dense[0].weight.pop_back(); }),
            "weight of term 'term' holds 9 numbers, expected 10");
  EXPECT_EQ(refusal([](Parts& p) { p.objective.dense[0].target.pop_back(); }),
            "target of term 'term' holds 29 numbers, expected 30");
  EXPECT_EQ(refusal([](Parts& p) { p.objective.dense[4].term.joint = 99; }),
            "joint of term 'term' is 99, the model has 7");
  EXPECT_EQ(refusal([](Parts& p) { p.objective.local[0].target.clear(); }),
            "target of term 'pose' holds 0 numbers, expected 130");
  EXPECT_EQ(refusal([](Parts& p) { p.objective.local[1].target.pop_back(); }),
            "target of term 'velocity' holds 109 numbers, expected 110");
  EXPECT_EQ(refusal([](Parts& p) { p.objective.local[2].dof_weight.pop_back(); }),
            "dof_weight of term 'acceleration' holds 10 numbers, expected 11");
  EXPECT_EQ(refusal([](Parts& p) {
              p.objective.callbacks.push_back({"own", 2, 9, 1.0, {}});
            }),
            "term 'own' has 2 rows of each of 9 frames, expected 10 frames");
}

TEST(Sizes, OfAState) {
  for (Formulation formulation : {Formulation::frames, Formulation::spline}) {
    const test::Case c = test::make_case({.formulation = formulation, .frames = kFrames});
    EXPECT_EQ(c.problem->state_size(), c.state.size());
    State longer = c.state, shorter = c.state, moved;
    longer.push_back(0.0);
    shorter.pop_back();
    for (const State& state : {longer, shorter}) {
      Evaluation e;
      Linearization lin;
      const std::vector<double> step(
          static_cast<std::size_t>(c.problem->nodes()) * c.problem->primal(), 0.0);
      EXPECT_THROW(c.problem->evaluate(state, e), ArgumentError);
      EXPECT_THROW(c.problem->linearize(state, 0.0, e, lin), ArgumentError);
      EXPECT_THROW(c.problem->retract(state, step.data(), moved), ArgumentError);
    }
  }
}

}  // namespace
}  // namespace trajopt
