// Primal-dual interior point method with a filter line search for staged nonlinear programs, after
// Waechter and Biegler, "On the implementation of an interior-point filter line-search algorithm
// for large-scale nonlinear programming", Math. Program. 106 (2006); numbers in brackets refer to
// its equations. `docs/interior_point.md` has the derivation and what differs.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "trajopt/interior_point/staged_problem.h"
#include "trajopt/linalg/schedule.h"
#include "trajopt/solver/solver.h"

namespace trajopt::interior_point {

enum class BarrierRule { monotone, adaptive };

struct Options {
  double tolerance = 1e-8;  // of the scaled optimality error E_0 (5)
  int max_iterations = 3000;
  double barrier = 0.1;  // mu at the start
  BarrierRule barrier_rule = BarrierRule::monotone;
  double bound_push = 1e-2;  // distance of the start from its bounds (kappa_1, kappa_2)
  bool warm_start = false;   // multipliers are given; push, multipliers and mu stay as they are
  bool scale = true;         // gradient-based scaling
  int refinements = 10;      // of a step, at most
  int threads = 1;
  linalg::Ordering ordering = linalg::Ordering::automatic;
};

struct Seconds {
  double evaluation = 0, assembly = 0, factorization = 0, solve = 0;
};

struct Record {
  int iteration = 0;
  double objective = 0;        // in the user's units
  double constraint_norm = 0;  // largest violation, in the user's units
  double error = 0;            // E_0: scaled optimality error
  double dual_norm = 0;        // |gradient of the Lagrangian|_inf, scaled
  double complementarity = 0;  // largest product of a bound's distance and multiplier, scaled
  double barrier = 0;          // mu
  double regularization = 0;   // delta_w of the step that led here
  double step_norm = 0;        // |alpha dx|_inf
  double primal_step = 0;      // alpha
  double dual_step = 0;        // alpha of the bound multipliers
  int trials = 0;              // points the line search looked at
  bool corrected = false;      // a second-order correction was taken
  bool restoration = false;    // this iterate comes from the restoration phase
  Seconds seconds;             // since the record before
  double elapsed = 0;
};

// Unknowns and multipliers in the user's units; bound multipliers are positive at an active upper
// and negative at an active lower bound, so that the Lagrangian is f + y.c + b.x.
struct Point {
  std::vector<double> x;
  std::vector<double> multipliers;        // rows; empty: estimated
  std::vector<double> bound_multipliers;  // variables; empty: 1 per bound
};

// Called with every iterate; false stops the solver.
using Observer = std::function<bool(const Record&, const double* x)>;

struct Outcome {
  Status status = Status::max_iterations;
  std::string message;
  int iterations = 0;
  double objective = 0;
  std::vector<Record> history;
  std::vector<double> violation;  // by row, signed: positive above the upper bound
};

// From `point` and back into it. Nothing is allocated between the first and the last iteration.
Outcome solve(StagedProblem& problem, const Options& options, Point& point,
              const Observer& observer = {});

}  // namespace trajopt::interior_point
