// The control flow of the default solver (funnel_sqp.h), for one problem: a sequence of questions
// to an executor, to be asked by somebody who may have other problems to ask for at the same time.
#pragma once

#include <functional>
#include <optional>

#include "trajopt/solver/executor.h"
#include "trajopt/solver/funnel_sqp.h"
#include "trajopt/solver/stopwatch.h"
#include "trajopt/solver/task.h"

namespace trajopt {

// Called after every iteration; false stops the solver.
using Report = std::function<bool(const IterationRecord&, SqpPoint&)>;

class Funnel {
 public:
  Funnel(SqpPoint& point, const FunnelOptions& options, Report report);
  Funnel(const Funnel&) = delete;

  // The first question. What the report throws comes out of here and of resume().
  const Request& begin();
  // The answer to the last question; returns the next one. Kind::nothing: the solve has ended.
  const Request& resume(const Answer& answer);
  const Result& result() const { return *result_; }

  CallFrames& frames() { return frames_; }

 private:
  // Hands a question to whoever runs this; goes on with the answer.
  struct Question {
    Funnel& funnel;
    bool await_ready() const noexcept { return false; }
    void await_suspend(std::coroutine_handle<> asker) noexcept { funnel.asker_ = asker; }
    const Answer& await_resume() const noexcept { return funnel.answer_; }
  };
  Question ask(const Request& request) {
    request_ = request;
    return {*this};
  }
  Question try_step(double ct, double cn) {
    return ask({.kind = Request::Kind::trial, .tangential = ct, .normal = cn});
  }
  Question try_correction(double zeta) {
    return ask({.kind = Request::Kind::correction, .zeta = zeta});
  }

  const Request& next();  // after each part of the run
  Task<Result> run();
  Task<bool> descend();
  Task<bool> step();
  Task<bool> solve_steps();
  Task<bool> move();
  Task<bool> restore();

  double predicted_decrease(double ct, double cn) const;
  bool accept(double predicted, double tangential, double zeta);
  double floor() const;
  bool report();
  bool has_settled();
  Result conclude(bool settled) const;
  Result failure() const;

  CallFrames frames_;
  SqpPoint& point_;
  const FunnelOptions options_;
  const Report report_;
  const Stopwatch watch_;
  double funnel_, narrow_, damping_, normal_radius_, growth_ = 2;
  PointValues current_, trial_;
  StepValues steps_{};
  std::vector<double> recent_;  // objective after the last window + 1 accepted steps, a ring
  std::size_t fallen_ = 0;      // accepted steps that count for it
  IterationRecord record_;
  std::optional<Result> stop_, result_;
  int iteration_ = 0;
  bool flat_ = false;

  Request request_;
  Answer answer_;
  std::coroutine_handle<> asker_;
  std::optional<Task<Result>> run_;  // last: its calls use the members above
};

// Asks an executor until the end.
Result run_funnel(SqpExecutor& executor, const FunnelOptions& options, Report report);

// A report that shows the state to an observer, which may be empty.
Report report_to(Observer observer);

}  // namespace trajopt
