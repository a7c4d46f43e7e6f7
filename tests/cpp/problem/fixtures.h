// A small character and problems with every kind of joint and term, and finite differences.
#pragma once

#include <cmath>
#include <memory>
#include <ostream>
#include <random>
#include <string>
#include <vector>

#include "trajopt/base/vec3.h"
#include "trajopt/model/configuration.h"
#include "trajopt/problem/kkt_system.h"
#include "trajopt/problem/trajectory_problem.h"

namespace trajopt::test {

class Random {
 public:
  explicit Random(unsigned seed) : generator_(seed) {}
  double operator()(double scale = 1.0) { return scale * normal_(generator_); }
  std::vector<double> vector(std::size_t n, double scale = 1.0) {
    std::vector<double> v(n);
    for (double& x : v) x = (*this)(scale);
    return v;
  }

 private:
  std::mt19937_64 generator_;
  std::normal_distribution<double> normal_;
};

inline Joint make_joint(JointType type, int parent, Vec3<double> at, Vec3<double> axis, double mass,
                        Vec3<double> center) {
  Joint j{};
  j.type = type;
  j.parent = parent;
  for (int k = 0; k < 9; ++k) j.offset[k] = k % 4 == 0 ? 1 : 0;
  for (int k = 0; k < 3; ++k) {
    j.offset[9 + k] = at[k];
    j.axis[k] = axis[k];
    j.first[k] = mass * center[k];
  }
  j.mass = mass;
  const double spread[6] = {0.02, 0.003, -0.002, 0.03, 0.001, 0.025};
  constexpr int kRow[6] = {0, 0, 0, 1, 1, 2}, kColumn[6] = {0, 1, 2, 1, 2, 2};
  for (int k = 0; k < 6; ++k)
    j.second[k] = mass * (spread[k] + center[kRow[k]] * center[kColumn[k]]);
  return j;
}

// Free base of mass 0.6; a leg on a tilted hinge; an arm on a ball with a sliding hand. Without
// balls, three hinges take the place of each.
inline Model make_character(bool balls = true) {
  Model m;
  const auto add = [&m](JointType type, int parent, Vec3<double> at, Vec3<double> axis,
                        double mass = 0, Vec3<double> center = {0, 0, 0}) {
    m.joints.push_back(make_joint(type, parent, at, axis, mass, center));
    return static_cast<int>(m.joints.size()) - 1;
  };
  const auto rotate = [&](int parent, Vec3<double> at, double mass, Vec3<double> center) {
    if (balls) return add(JointType::ball, parent, at, {1, 0, 0}, mass, center);
    int joint = add(JointType::hinge, parent, at, {0, 0, 1});
    joint = add(JointType::hinge, joint, {0, 0, 0}, {0, 1, 0});
    return add(JointType::hinge, joint, {0, 0, 0}, {1, 0, 0}, mass, center);
  };
  int base = add(JointType::slide, -1, {0, 0, 0}, {1, 0, 0});
  base = add(JointType::slide, base, {0, 0, 0}, {0, 1, 0});
  base = add(JointType::slide, base, {0, 0, 0}, {0, 0, 1});
  base = rotate(base, {0, 0, 0}, 0.6, {0.05, -0.02, 0.1});
  const int leg = add(JointType::hinge, base, {0.1, 0.2, -0.1}, {0.6, 0.8, 0}, 0.2, {0, 0, -0.3});
  const int arm = rotate(base, {-0.2, 0.1, 0.2}, 0.15, {0.2, 0.1, 0});
  const int hand = add(JointType::slide, arm, {0.4, 0, 0}, {0, 0.6, 0.8}, 0.05, {0.05, 0, 0});
  finalize(m);
  for (int k = 0; k < m.ndof; ++k) {
    (k < 6 ? m.unactuated : m.actuated).push_back(k);
    m.lower.push_back(k < 6 ? -HUGE_VAL : -0.4);
    m.upper.push_back(k < 6 ? HUGE_VAL : 0.4);
  }
  m.points = {{leg, {0, 0, -0.6}, 0.1}, {hand, {0.1, 0, 0}, 0.05}, {base, {0, 0.3, 0}, 0.2}};
  return m;
}

inline Physics make_physics(Integrator integrator) {
  Physics p;
  p.gravity[2] = -1;
  p.ground = true;
  p.plane_offset = 0.3;
  p.normal = 30;
  p.friction = 20;
  p.damping = 1;
  p.limit = 3;
  p.integrator = integrator;
  return p;
}

struct Setup {
  Formulation formulation = Formulation::frames;
  int frames = 10;
  int frames_per_knot = 5;
  bool uneven = false;
  bool periodic = false;
  bool balls = true;
  double turn = 0.3;  // size of the steps that separate neighbouring nodes
  Integrator integrator = Integrator::linear_acceleration;
  int threads = 1;
};

struct Case {
  std::unique_ptr<TrajectoryProblem> problem;
  State state;
};

inline Objective every_term(const Model& model, int frames, Random& random) {
  Objective o;
  const auto weights = [&](double scale) {
    std::vector<double> w(frames);
    for (double& x : w) x = scale * (1 + std::abs(random()));
    return w;
  };
  const auto dense = [&](DenseKind kind, double weight, bool target) {
    DenseObjective t{.name = "term", .term = {}, .weight = weights(weight), .target = {}};
    t.term.kind = kind;
    t.term.joint = static_cast<int>(model.joints.size()) - 1;
    for (int k = 0; k < 3; ++k) {
      t.term.point[k] = random(0.2);
      t.term.axes[k] = 1 + 0.5 * k;
    }
    if (target) t.target = random.vector(3 * static_cast<std::size_t>(frames));
    o.dense.push_back(std::move(t));
  };
  dense(DenseKind::center_of_mass_velocity, 0.5, true);
  dense(DenseKind::center_of_mass_position, 0.3, true);
  dense(DenseKind::effort, 0.01, false);
  dense(DenseKind::physics, 0.02, false);
  dense(DenseKind::point_position, 0.4, true);
  dense(DenseKind::point_velocity, 0.1, true);
  dense(DenseKind::contact_rate, 0.01, false);
  dense(DenseKind::contact_slip, 0.1, false);
  dense(DenseKind::contact_impact, 0.1, false);
  std::vector<double> pose;
  for (int i = 0; i < frames; ++i) {
    std::vector<double> q(model.nq);
    configuration_from_vector(model, random.vector(model.ndof, 0.5).data(), q.data());
    pose.insert(pose.end(), q.begin(), q.end());
  }
  std::vector<double> dof(model.ndof);
  for (double& w : dof) w = 0.5 + std::abs(random());
  o.local.push_back({"pose", LocalKind::pose, weights(0.7), dof, pose});
  o.local.push_back({"velocity", LocalKind::velocity, weights(0.2), dof,
                     random.vector(static_cast<std::size_t>(frames) * model.ndof)});
  o.local.push_back({"acceleration", LocalKind::acceleration, weights(0.01), dof, {}});
  return o;
}

// The terms whose residuals are linear in slides and hinges.
inline Objective quadratic_terms(const Model& model, int frames, Random& random) {
  Objective o = every_term(model, frames, random);
  o.dense.clear();
  return o;
}

inline Objective effort_only(int frames, double weight) {
  Objective o;
  DenseObjective t{
      .name = "effort", .term = {}, .weight = std::vector<double>(frames, weight), .target = {}};
  t.term.kind = DenseKind::effort;
  o.dense.push_back(std::move(t));
  return o;
}

// A problem around a random walk of configurations.
inline Case make_case(const Setup& setup, const Model& model, const Objective& objective,
                      Random& random) {
  ProblemOptions options;
  options.formulation = setup.formulation;
  options.frames_per_knot = setup.frames_per_knot;
  options.periodic = setup.periodic;
  options.stride[0] = 0.4;
  options.threads = setup.threads;
  std::vector<double> dt(setup.frames + 1);
  for (double& h : dt) h = setup.uneven ? 0.15 + 0.1 * std::abs(random()) : 0.2;
  std::vector<double> initial(2 * model.nq), q(model.nq);
  configuration_from_vector(model, random.vector(model.ndof, 0.3).data(), q.data());
  std::copy(q.begin(), q.end(), initial.begin());
  integrate(model, q.data(), random.vector(model.ndof, 0.05).data(), q.data());
  std::copy(q.begin(), q.end(), initial.begin() + model.nq);
  Case c;
  c.problem =
      std::make_unique<TrajectoryProblem>(model, make_physics(setup.integrator), dt, objective,
                                          initial, random.vector(model.ndof, 0.3), options);
  for (int i = 0; i < c.problem->nodes(); ++i) {
    integrate(model, q.data(), random.vector(model.ndof, setup.turn).data(), q.data());
    c.state.insert(c.state.end(), q.begin(), q.end());
  }
  if (setup.formulation == Formulation::spline) {
    const auto v =
        random.vector(static_cast<std::size_t>(c.problem->nodes()) * model.ndof, setup.turn);
    c.state.insert(c.state.end(), v.begin(), v.end());
  }
  return c;
}

inline Case make_case(const Setup& setup, unsigned seed = 1) {
  Random random(seed);
  const Model model = make_character(setup.balls);
  const Objective objective = every_term(model, setup.frames, random);
  return make_case(setup, model, objective, random);
}

// Derivative of a vector-valued function of the state along every unknown, by fourth-order central
// differences: result[j] is the column of unknown j. The step is short, as contact and limits are
// only C1.
template <class Function>
std::vector<std::vector<double>> differences(const TrajectoryProblem& problem, const State& state,
                                             const Function& function, double h = 2e-5) {
  const std::size_t n = static_cast<std::size_t>(problem.nodes()) * problem.primal();
  std::vector<std::vector<double>> columns(n);
  std::vector<double> step(n, 0.0);
  State moved;
  for (std::size_t j = 0; j < n; ++j) {
    const auto at = [&](double s) {
      step[j] = s;
      problem.retract(state, step.data(), moved);
      step[j] = 0;
      return function(moved);
    };
    const auto a = at(h), b = at(-h), c = at(2 * h), d = at(-2 * h);
    columns[j].resize(a.size());
    for (std::size_t i = 0; i < a.size(); ++i)
      columns[j][i] = (8 * (a[i] - b[i]) - (c[i] - d[i])) / (12 * h);
  }
  return columns;
}

inline double largest(const std::vector<double>& v) {
  double r = 0;
  for (double x : v) r = std::max(r, std::abs(x));
  return r;
}
inline double largest(const std::vector<std::vector<double>>& v) {
  double r = 0;
  for (const auto& x : v) r = std::max(r, largest(x));
  return r;
}

// The dense matrix behind KktSystem::multiply.
inline std::vector<std::vector<double>> dense(const KktSystem& kkt) {
  std::vector<std::vector<double>> columns(kkt.rows());
  std::vector<double> x(kkt.rows(), 0.0);
  for (long j = 0; j < kkt.rows(); ++j) {
    x[j] = 1;
    kkt.multiply(x, columns[j]);
    x[j] = 0;
  }
  return columns;
}

// Row of unknown j (node-major tangents) and of constraint r in the KKT system.
inline long tangent_row(const KktSystem& kkt, std::size_t j) {
  const int node = static_cast<int>(j) / kkt.primal();
  return kkt.offset(node) + kkt.dual() + static_cast<long>(j) % kkt.primal();
}
inline long constraint_row(const KktSystem& kkt, std::size_t r) {
  const int node = static_cast<int>(r) / kkt.dual();
  return kkt.offset(node) + static_cast<long>(r) % kkt.dual();
}

struct Named {
  std::string name;
  Setup setup;
};

inline void PrintTo(const Named& named, std::ostream* out) { *out << named.name; }

// One setup of each kind.
inline std::vector<Named> all_setups() {
  const Formulation spline = Formulation::spline;
  return {
      {"frames", {}},
      {"frames_odd", {.frames = 9}},
      {"frames_uneven", {.uneven = true}},
      {"frames_implicit", {.uneven = true, .integrator = Integrator::implicit}},
      {"frames_large_turns", {.turn = 0.9}},
      {"ring", {.periodic = true}},
      {"ring_uneven", {.frames = 12, .uneven = true, .periodic = true}},
      {"spline", {.formulation = spline, .frames = 20}},
      {"spline_odd", {.formulation = spline, .frames = 15, .integrator = Integrator::implicit}},
      {"spline_short", {.formulation = spline, .frames = 12, .frames_per_knot = 2}},
      {"spline_uneven", {.formulation = spline, .frames = 20, .uneven = true}},
      {"spline_large_turns", {.formulation = spline, .frames = 20, .turn = 1.2}},
  };
}

}  // namespace trajopt::test
