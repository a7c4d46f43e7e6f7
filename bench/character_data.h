// Reads what characters.py writes: a character, its force law and a few frames, in scaled units.
#pragma once

#include <cmath>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "trajopt/force/physics.h"
#include "trajopt/model/configuration.h"
#include "trajopt/model/model.h"

namespace trajopt::bench {

struct Character {
  Model model;
  Physics physics;
  double dt;
  std::vector<double> frames;  // n x nq
};

inline Character read_character(const std::string& name) {
  const std::string path = std::string(TRAJOPT_BENCH_DATA) + "/" + name + ".txt";
  std::ifstream file(path);
  const auto number = [&] {
    double value;
    if (!(file >> value)) throw std::runtime_error(path + ": not what characters.py writes");
    return value;
  };
  const auto count = [&] { return static_cast<int>(number()); };
  Character c;
  const int joints = count(), points = count(), spheres = count(), pairs = count();
  const int frames = count();
  c.dt = number();
  int dofs = 0;
  for (int j = 0; j < joints; ++j) {
    Joint joint{};
    joint.type = static_cast<JointType>(count());
    joint.parent = count();
    for (int r = 0; r < 3; ++r)
      for (int k = 0; k < 4; ++k) joint.offset[k < 3 ? 3 * r + k : 9 + r] = number();
    for (double& a : joint.axis) a = number();
    double inertia[16];
    for (double& e : inertia) e = number();
    constexpr int kSecond[6] = {0, 1, 2, 5, 6, 10};
    for (int k = 0; k < 6; ++k) joint.second[k] = inertia[kSecond[k]];
    for (int k = 0; k < 3; ++k) joint.first[k] = inertia[4 * k + 3];
    joint.mass = inertia[15];
    dofs += joint.ndof();
    c.model.joints.push_back(joint);
  }
  const auto limit = [&] {
    const double value = number();
    return std::abs(value) < 1e300 ? value : std::copysign(HUGE_VAL, value);
  };
  for (int j = 0; j < dofs; ++j) c.model.lower.push_back(limit());
  for (int j = 0; j < dofs; ++j) c.model.upper.push_back(limit());
  for (int j = 0; j < dofs; ++j)
    (number() != 0 ? c.model.actuated : c.model.unactuated).push_back(j);
  for (int k = 0; k < points + spheres; ++k) {
    ContactPoint point{};
    point.joint = count();
    for (double& p : point.position) p = number();
    point.radius = number();
    (k < points ? c.model.points : c.model.spheres).push_back(point);
  }
  for (int k = 0; k < pairs; ++k) {
    const int a = count(), b = count();
    c.model.pairs.push_back({a, b});
  }
  finalize(c.model);
  c.physics.gravity[2] = -1;
  c.physics.ground = true;
  c.physics.normal = number();
  c.physics.friction = number();
  c.physics.damping = number();
  c.physics.coulomb = number() != 0;
  c.physics.mu = number();
  c.physics.slip_velocity = number();
  c.physics.limit = number();
  c.physics.self_collision = number();
  c.frames.resize(static_cast<std::size_t>(frames) * c.model.nq);
  std::vector<double> x(c.model.ndof);
  for (int i = 0; i < frames; ++i) {
    for (double& e : x) e = number();
    configuration_from_vector(c.model, x.data(), c.frames.data() + i * c.model.nq);
  }
  return c;
}

}  // namespace trajopt::bench
