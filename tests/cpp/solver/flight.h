// A character thrown into the air is to take a pose: physics holds exactly at the start, and its
// momentum may not change on the way.
#pragma once

#include "problem/fixtures.h"
#include "trajopt/solver/solver.h"

namespace trajopt::test {

inline Case make_flight(Formulation formulation, int threads = 1) {
  const int frames = 40;
  const double dt = 0.05;
  const Model model = make_character();
  Physics physics = make_physics(Integrator::linear_acceleration);
  physics.ground = false;
  const auto height = [&](int i) { return -0.5 * (i * dt) * (i * dt); };
  const auto falling = [&](int i) {
    std::vector<double> x(model.ndof, 0.0), q(model.nq);
    x[2] = height(i);
    configuration_from_vector(model, x.data(), q.data());
    return q;
  };
  Random random(11);
  std::vector<double> target(model.nq), pose = random.vector(model.ndof, 0.3);
  std::copy_n(falling(frames).begin(), 3, pose.begin());
  configuration_from_vector(model, pose.data(), target.data());

  const std::size_t n = frames;
  Objective objective = effort_only(frames, 1e-2 / frames);
  LocalObjective reach{"pose",
                       LocalKind::pose,
                       std::vector<double>(n, 0.0),
                       std::vector<double>(model.ndof, 1.0),
                       {}};
  for (int i = 0; i < frames; ++i)
    reach.target.insert(reach.target.end(), target.begin(), target.end());
  reach.weight.back() = 1;
  objective.local.push_back(reach);
  objective.local.push_back({"acceleration",
                             LocalKind::acceleration,
                             std::vector<double>(n, 1e-3 / frames),
                             std::vector<double>(model.ndof, 1.0),
                             {}});

  ProblemOptions options;
  options.formulation = formulation;
  options.threads = threads;
  std::vector<double> initial = falling(-1), guess;
  const std::vector<double> first = falling(0);
  initial.insert(initial.end(), first.begin(), first.end());
  for (int i = 1; i <= frames; ++i) {
    const std::vector<double> q = falling(i);
    guess.insert(guess.end(), q.begin(), q.end());
  }
  Case c;
  c.problem = std::make_unique<TrajectoryProblem>(
      model, physics, std::vector<double>(frames + 1, dt), objective, initial,
      std::vector<double>(model.ndof, 0.0), options);
  c.state = c.problem->state_from_frames(guess.data());
  if (formulation ==
      Formulation::spline) {  // fit() differs by the ends; a cubic holds the parabola
    const int nodes = c.problem->nodes();
    for (int z = 1; z <= nodes; ++z) {
      const double span = 10 * dt;  // of a segment
      double* v = c.state.data() + nodes * model.nq + (z - 1) * model.ndof;
      std::fill_n(v, model.ndof, 0.0);
      v[2] = -z * span * span;
    }
  }
  return c;
}

// Keeps every record, and checks what holds for all solvers.
struct Recorder {
  std::vector<IterationRecord> records;
  int stop_after = -1;
  Observer observer() {
    return [this](const IterationRecord& record, const State&) {
      records.push_back(record);
      return static_cast<int>(records.size()) != stop_after;
    };
  }
};

}  // namespace trajopt::test
