// The vector work of an SQP iteration, behind the few numbers its decisions are made of.
//
// A solver holds one executor and never touches a vector: it asks for a factorization, for the two
// steps of an iteration, for the values where a combination of them leads, and says whether to go
// there. What memory the vectors live in, and on which device, is the executor's affair.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "trajopt/linalg/schedule.h"
#include "trajopt/problem/step_rows.h"
#include "trajopt/problem/trajectory_problem.h"
#include "trajopt/solver/solver.h"

namespace trajopt {

// What is known of a point of the search space.
struct PointValues {
  double objective = 0;
  double constraint_norm = 0;  // |C|_inf
  double frame_violation = 0;  // max over frames and unactuated rows

  bool finite() const;
};

// What is known of the tangential step t (A t = 0) and the normal step n (A n = -C).
struct StepValues {
  double item[kStepItems];  // see StepItem

  // Of d = ct t + cn n, in the metric W.
  double norm(double ct, double cn) const;

  // Decrease of the quadratic model of the objective along d = ct t + cn n, without the damping and
  // the augmentation that the factored matrix holds. No product with the matrix is needed: with M
  // the damped Hessian, the KKT equations give t.M t = -g.t, n.M n = y_n.C and t.M n = 0.
  double predicted_decrease(double ct, double cn, double damping, double augmentation) const;
};

struct ExecutorOptions {
  double smoothing;     // of the metric W
  double augmentation;  // this times A^T A is added to H
  double epsilon;       // on the multiplier diagonal
  linalg::Ordering ordering;
};

class SqpExecutor {
 public:
  virtual ~SqpExecutor() = default;

  // Values and derivatives at the current point.
  virtual PointValues linearize() = 0;
  // Objective by term there, in the order of Objective::names().
  virtual const std::vector<double>& terms() const = 0;
  // The current point, in the vector the executor was made with.
  virtual const State& state() = 0;

  // Assembles and factors the KKT matrix at the current linearization; false when its inertia is
  // wrong, and why in error().
  virtual bool factor(double damping) = 0;
  virtual const std::string& error() const = 0;

  // Solves for the tangential and the normal step.
  virtual StepValues solve_steps() = 0;

  // Values at the current point moved by d = ct t + cn n: the trial.
  virtual PointValues try_step(double ct, double cn) = 0;
  // Second-order correction of the trial's d, for A d = -zeta C, with the factorization at hand:
  // the corrected point becomes the trial.
  virtual PointValues try_correction(double zeta) = 0;
  // The trial before the last correction is the trial again.
  virtual void undo_correction() = 0;
  // The trial becomes the current point. linearize() has to follow.
  virtual void accept() = 0;

  // Time spent since the last call, by phase.
  virtual PhaseSeconds take_seconds() = 0;
  virtual std::string device() const = 0;
};

// On the processor, with the threads of the problem. Moves `state` in place.
std::unique_ptr<SqpExecutor> make_cpu_executor(TrajectoryProblem& problem,
                                               const ExecutorOptions& options, State& state);

}  // namespace trajopt
