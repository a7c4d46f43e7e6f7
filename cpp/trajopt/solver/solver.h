// What every solver of a TrajectoryProblem takes and gives back.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "trajopt/linalg/schedule.h"
#include "trajopt/problem/trajectory_problem.h"

namespace trajopt {

enum class Status {
  solved,            // constraint and objective tolerances met
  max_iterations,    // the iteration limit came first
  stalled,           // no acceptable step left, tolerances not met
  interrupted,       // the observer asked to stop
  infeasible,        // the linearized constraints cannot be reduced any further
  numerical_failure  // the KKT matrix could not be factored, or values are not finite
};

const char* status_name(Status status);

struct PhaseSeconds {  // of one iteration
  double dynamics = 0, assembly = 0, factorization = 0, solve = 0;
};

struct IterationRecord {
  int iteration = 0;
  double objective = 0;
  std::vector<double> terms;
  double constraint_norm = 0;  // |C|_inf
  double frame_violation = 0;  // max over frames of the unactuated residual
  double penalty = 0;          // mu of the merit function, or the funnel's width
  double radius = 0;
  double damping = 0;
  double step_norm = 0;
  double gain_ratio = 0;  // actual / predicted decrease
  bool accepted = false;
  PhaseSeconds seconds;
  double elapsed = 0;
  linalg::Ordering ordering = linalg::Ordering::automatic;  // what `automatic` became
};

// Called after every iteration with the current (best) state; false stops the solver.
using Observer = std::function<bool(const IterationRecord&, const State&)>;

struct Result {
  Status status = Status::max_iterations;
  std::string message;
  int iterations = 0;
  linalg::Ordering ordering = linalg::Ordering::automatic;  // what `automatic` became
};

}  // namespace trajopt
