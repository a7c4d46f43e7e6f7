// Problems with terms that are functions on the host, as a user's are.
#pragma once

#include <stdexcept>

#include "problem/fixtures.h"

namespace trajopt::test {

// Of slides, which are configuration and tangent at once: how far the base is from a height, its
// climb, and the curvature of the way, which sees three frames.
inline CallbackObjective height_function(const Model& model, int frames, double height,
                                         int* calls = nullptr, int throw_after = -1) {
  const int nq = model.nq, d = model.ndof;
  const auto evaluate = [=, count = 0](const double* q, double* residual,
                                       double* jacobian) mutable {
    if (throw_after >= 0 && count++ >= throw_after) throw std::domain_error("not here");
    if (calls != nullptr) ++*calls;
    for (int f = 0; f < frames; ++f) {
      const double *x = q + (f + 2) * nq, *x1 = x - nq, *x2 = x1 - nq;
      double* r = residual + 3 * f;
      r[0] = std::sin(x[2]) - height;
      r[1] = 3 * (x[2] - x1[2]) * (x[0] + 1);
      r[2] = x[1] - 2 * x1[1] + x2[1];
      if (jacobian == nullptr) continue;
      double* j = jacobian + static_cast<long>(f) * 3 * 3 * d;  // by frames i, i - 1, i - 2
      std::fill_n(j, 9 * d, 0.0);
      j[2] = std::cos(x[2]);
      j += 3 * d;
      j[2] = 3 * (x[0] + 1);
      j[0] = 3 * (x[2] - x1[2]);
      j[d + 2] = -3 * (x[0] + 1);
      j += 3 * d;
      j[1] = 1;
      j[d + 1] = -2;
      j[2 * d + 1] = 1;
    }
  };
  return {"height", 3, frames, 0.3, evaluate};
}

// One row: the speed of the base along x.
inline CallbackObjective speed_function(const Model& model, int frames, double speed) {
  const int nq = model.nq, d = model.ndof;
  const auto evaluate = [=](const double* q, double* residual, double* jacobian) {
    for (int f = 0; f < frames; ++f) {
      residual[f] = 5 * (q[(f + 2) * nq] - q[(f + 1) * nq]) - speed;
      if (jacobian == nullptr) continue;
      double* j = jacobian + static_cast<long>(f) * 3 * d;
      std::fill_n(j, 3 * d, 0.0);
      j[0] = 5;
      j[d] = -5;
    }
  };
  return {"speed", 1, frames, 0.7, evaluate};
}

// Two functions beside every other term. `calls` counts those of the first.
inline Case make_case_with_functions(const Setup& setup, unsigned seed = 1, int* calls = nullptr,
                                     int throw_after = -1) {
  Random random(seed);
  const Model model = make_character(setup.balls);
  Objective objective = every_term(model, setup.frames, random);
  objective.callbacks.push_back(
      height_function(model, setup.frames, 0.1 * seed, calls, throw_after));
  objective.callbacks.push_back(speed_function(model, setup.frames, 0.2));
  return make_case(setup, model, objective, random);
}

}  // namespace trajopt::test
