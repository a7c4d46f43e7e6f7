// Pan's Algorithm 1: a Newton-type trust-region SQP, as printed.
//
//   (9)   E(d) = d.H d / 2 + d.b,  C(d) = A d + C0,  H = J^T J
//   (10)  min E(d)  s.t.  C(d) = 0, |d| < radius    in the span of two directions
//   (11)  mu >= E(d) / (|C0|^2 / 2), never decreasing
//   (12)  [H A^T; A 0]                               Newton's step by one factorization
//
// A step is taken when it lowers mu/2 |C|^2 + E and |C|_inf < C_max afterwards. It is the baseline
// other methods are measured against; where the paper is silent, the plainest reading is taken.
#pragma once

#include "trajopt/problem/kkt_system.h"
#include "trajopt/solver/solver.h"

namespace trajopt {

// Constants of the paper, in the problem's own units (the paper's C_max and eps_C are in newtons).
struct PaperOptions {
  int max_iterations = 3000;
  double constraint_limit = 0.1;       // C_max
  double constraint_tolerance = 1e-5;  // eps_C
  double step_tolerance = 1e-3;        // eps_E
  double growth = 1.2;                 // of the radius after an accepted step
  double shrink = 0.8;                 // of a rejected step's length
  double normal_share = 0.8;           // of the radius that restoring C may use (Nocedal 18.5)
  double penalty = 1e-8;               // mu to begin with: the paper gives none
  double damping = 1e-6;               // H + damping * (largest diagonal of H) I
  double epsilon = 1e-10;              // on the multiplier diagonal, refined away
  int conjugate_gradient_steps = 200;
  double smallest_radius = 1e-10;  // where to give up
  linalg::Ordering ordering = linalg::Ordering::automatic;
};

// Improves `state` in place; it always holds the last accepted iterate.
Result solve_paper(TrajectoryProblem& problem, const PaperOptions& options, State& state,
                   const Observer& observer);

}  // namespace trajopt
