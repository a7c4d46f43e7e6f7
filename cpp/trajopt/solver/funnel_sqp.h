// The default solver: Levenberg-Marquardt SQP inside a funnel.
//
//   [H + lambda W  A^T] [d]     [-g]        W = I + smoothing D2^T D2
//   [A             0  ] [y]  =  [-C]
//
// One factorization per step: lambda plays the trust region, so the step is the exact minimizer of
// the model in a ball of W. Up to two second-order corrections reuse the factorization. A funnel of
// width tau bounds the constraint violation (Gould and Toint 2010): a step that mostly lowers the
// objective must lower it and stay inside; a step that mostly restores physics must restore it, and
// narrows the funnel. When the objective has settled, pure restoration steps finish the physics.
#pragma once

#include "trajopt/solver/executor.h"

namespace trajopt {

struct FunnelOptions {
  int max_iterations = 500;
  double constraint_tolerance = 1e-9;  // |C|_inf, body weights
  double objective_tolerance = 1e-3;   // relative decrease over `window` iterations
  int window = 10;
  double funnel = 0.4;  // initial width, body weights per frame
  double smoothing = 60;
  double damping = 1e-2;  // initial lambda
  double augmentation = 1e-3;
  double epsilon = 1e-10;    // on the multiplier diagonal
  double normal_radius = 6;  // longest restoration step in W
  int corrections = 2;
  bool restore = true;  // finish with restoration steps to constraint_tolerance
  linalg::Ordering ordering = linalg::Ordering::automatic;
};

inline ExecutorOptions executor_options(const FunnelOptions& o) {
  return {o.smoothing, o.augmentation, o.epsilon, o.ordering};
}

// Improves `state` in place, on the processor; it always is the best iterate.
Result solve_funnel(TrajectoryProblem& problem, const FunnelOptions& options, State& state,
                    const Observer& observer);

}  // namespace trajopt
