#include "trajopt/force/physics.h"

#include <algorithm>
#include <cmath>

namespace trajopt {

namespace {

double newmark_beta(Integrator integrator) {
  switch (integrator) {
    case Integrator::fox_goodwin:
      return 1.0 / 12;
    case Integrator::linear_acceleration:
      return 1.0 / 6;
    case Integrator::trapezoidal:
      return 1.0 / 4;
    default:
      return 0;
  }
}

// Weight theta of the newer velocity at the middle node. 1/2 is second order; stiff friction needs
// more, or the sliding velocity flips its sign every frame. A point under its static load slides
// with the factor z = (1 - 2 (1 - theta) a)/(1 + 2 theta a) a frame, a = g (w_t/w_n) dt / 2; theta
// is the least that keeps z >= -kFlip: a flip that dies out within frames costs less accuracy than
// first-order friction does.
constexpr double kFlip = 0.5;

double friction_theta(const Physics& p, double dt) {
  if (p.normal <= 0) return 0.5;
  const double g = std::sqrt(p.gravity[0] * p.gravity[0] + p.gravity[1] * p.gravity[1] +
                             p.gravity[2] * p.gravity[2]);
  const double ratio = p.coulomb ? p.mu / p.slip_velocity : p.friction / p.normal;
  const double rate = g * ratio * dt;  // 2 a
  return std::max(0.5, (rate - 1 - kFlip) / (std::max(rate, 1.0) * (1 + kFlip)));
}

}  // namespace

Stencil make_stencil(const Physics& physics, double dt, double dt_before) {
  Stencil s{};
  const double h = dt, k = dt_before, mean = 0.5 * (h + k);
  s.acceleration[0] = 1 / (h * mean);
  s.acceleration[2] = 1 / (k * mean);
  s.acceleration[1] = -(s.acceleration[0] + s.acceleration[2]);
  if (physics.integrator == Integrator::implicit) {
    s.contact[0] = 1;
    s.velocity[0][0] = 1 / h;
    s.velocity[0][1] = -1 / h;
    return s;
  }
  const double beta = newmark_beta(physics.integrator);
  s.contact[0] = beta * h / mean;
  s.contact[2] = beta * k / mean;
  s.contact[1] = 1 - 2 * beta;
  const double theta = friction_theta(physics, mean);
  const double theta2 = std::max(0.0, 2 * theta - 1);
  const auto blend = [h, k](double* row, double newer) {
    row[0] = newer / h;
    row[1] = (1 - newer) / k - newer / h;
    row[2] = -(1 - newer) / k;
  };
  blend(s.velocity[0], 1.0);
  blend(s.velocity[1], theta);
  blend(s.velocity[2], theta2);
  return s;
}

}  // namespace trajopt
