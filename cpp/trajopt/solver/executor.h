// The vector work of an SQP iteration, behind the few numbers its decisions are made of.
//
// A solver never touches a vector: it asks for the two steps of an iteration, for the values where
// a combination of them leads, and says whether to go there. What memory the vectors live in, on
// which device, and how many problems are worked on together, is the executor's affair.
#pragma once

#include <exception>
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

// What a solver asks for next, of one problem.
struct Request {
  enum class Kind {
    linearize,   // values and derivatives at the current point
    steps,       // factor at `damping`, solve for both steps
    trial,       // values at the current point moved by `tangential` t + `normal` n
    correction,  // second-order correction of the trial's step, for A d = -zeta C: the new trial
    move,        // the trial becomes the current point; linearize there
    nothing      // the end
  };
  static constexpr int kKinds = static_cast<int>(Kind::nothing);

  Kind kind = Kind::nothing;
  double damping = 0;
  double tangential = 0, normal = 0;
  double zeta = 0;
};

struct Answer {
  bool factored = true;  // to `steps`: false when the inertia is wrong, and why in error()
  StepValues steps{};    // to `steps`
  PointValues point;     // to all others
  // What a function of the user threw, by an executor of a batch; there is no other answer then.
  std::exception_ptr error;
};

// One problem in the hands of an executor: what is known of it without any work.
class SqpPoint {
 public:
  virtual ~SqpPoint() = default;

  // Objective by term at the current point, in the order of Objective::names().
  virtual const std::vector<double>& terms() const = 0;
  // The current point, in the vector the executor was made with.
  virtual const State& state() = 0;
  // Elimination order of the KKT matrix; never automatic.
  virtual linalg::Ordering ordering() const = 0;
  // Of the last factorization that failed.
  virtual const std::string& error() const = 0;
  // The trial before the last correction is the trial again.
  virtual void undo_correction() = 0;
  // Time spent since the last call, by phase.
  virtual PhaseSeconds take_seconds() = 0;
};

// An executor of one problem.
class SqpExecutor : public SqpPoint {
 public:
  virtual Answer answer(const Request& request) = 0;
};

struct BatchMember {
  TrajectoryProblem* problem;
  State* state;  // moved in place
};

// An executor of many problems of one shape (see same_shape() in batch.h), which answers requests
// of one kind together.
class BatchExecutor {
 public:
  virtual ~BatchExecutor() = default;

  virtual int size() const = 0;
  virtual SqpPoint& point(int problem) = 0;
  // requests and answers by problem; all that `problems` names are of the given kind.
  virtual void answer(Request::Kind kind, const std::vector<int>& problems,
                      const std::vector<Request>& requests, std::vector<Answer>& answers) = 0;
};

// On the processor, with the threads of the problem. Moves `state` in place.
std::unique_ptr<SqpExecutor> make_cpu_executor(TrajectoryProblem& problem,
                                               const ExecutorOptions& options, State& state);

}  // namespace trajopt
