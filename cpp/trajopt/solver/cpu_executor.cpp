// The executor on the processor: TrajectoryProblem evaluates, KktSystem solves.
#include <algorithm>
#include <utility>

#include "trajopt/base/error.h"
#include "trajopt/base/parallel.h"
#include "trajopt/problem/kkt_system.h"
#include "trajopt/problem/node_kernels.h"
#include "trajopt/solver/executor.h"
#include "trajopt/solver/stopwatch.h"

namespace trajopt {

namespace {

class CpuExecutor final : public SqpExecutor {
 public:
  CpuExecutor(TrajectoryProblem& problem, const ExecutorOptions& options, State& state)
      : problem_(problem),
        options_(options),
        kernels_(node_kernels()),
        kkt_(problem, options.smoothing, choose(problem, options.ordering)),
        state_(state),
        solution_(2 * kkt_.rows()),
        correction_(kkt_.rows()),
        items_(static_cast<std::size_t>(kStepItems) * kkt_.nodes()) {
    lin_.by_nodes = kkt_.ordering() == linalg::Ordering::frontal;
    for (Trial& t : trials_) {
      t.step.resize(static_cast<std::size_t>(kkt_.nodes()) * kkt_.primal());
      t.state.resize(state.size());
    }
  }

  Answer answer(const Request& r) override {
    Answer a;
    switch (r.kind) {
      case Request::Kind::move:
        std::swap(state_, trial().state);
        [[fallthrough]];
      case Request::Kind::linearize:
        a.point = linearize();
        break;
      case Request::Kind::steps:
        a.factored = factor(r.damping);
        if (a.factored) a.steps = solve_steps();
        break;
      case Request::Kind::trial:
        a.point = try_step(r.tangential, r.normal);
        break;
      case Request::Kind::correction:
        a.point = try_correction(r.zeta);
        break;
      case Request::Kind::nothing:
        break;
    }
    return a;
  }

  const std::vector<double>& terms() const override { return current_.terms; }
  const State& state() override { return state_; }
  linalg::Ordering ordering() const override { return kkt_.ordering(); }
  const std::string& error() const override { return error_; }
  void undo_correction() override { at_ = 1 - at_; }
  PhaseSeconds take_seconds() override { return std::exchange(seconds_, {}); }

 private:
  struct Trial {
    std::vector<double> step;  // nodes x primal
    State state;
    Evaluation point;
  };

  static linalg::Ordering choose(const TrajectoryProblem& problem, linalg::Ordering asked) {
    const bool automatic = asked == linalg::Ordering::automatic;
    return automatic && KktSystem::frontal_possible(problem) ? linalg::Ordering::frontal : asked;
  }

  Trial& trial() { return trials_[at_]; }

  PointValues linearize() {
    watch_.lap();
    problem_.linearize(state_, options_.augmentation, current_, lin_);
    seconds_.dynamics += watch_.lap();
    return values(current_);
  }

  // With the first half of the steps.
  bool factor(double damping) {
    watch_.lap();
    kkt_.assemble(lin_, damping);
    seconds_.assembly += watch_.lap();
    const StepRows rows = step_rows();
    for_nodes([&](long begin, long end) { kernels_.write_steps_rhs(rows, begin, end); });
    std::fill(solution_.begin() + 2 * kkt_.offset(kkt_.nodes()), solution_.end(), 0.0);
    bool good = true;
    try {
      kkt_.factor_and_begin(options_.epsilon, solution_, 2);
    } catch (const FactorizationError& error) {
      error_ = error.what();
      good = false;
    }
    seconds_.factorization += watch_.lap();
    return good;
  }

  StepValues solve_steps() {
    watch_.lap();
    kkt_.finish(solution_, 2);
    const StepRows rows = step_rows();
    const long n = kkt_.nodes();
    for_nodes(
        [&](long begin, long end) { kernels_.measure_steps(rows, begin, end, items_.data(), n); });
    StepValues v;
    for (int k = 0; k < kMultiplier; ++k) v.item[k] = folded<Sum>(items_.data() + k * n, n);
    // The spline's C is not what the augmentation adds the squares of.
    if (problem_.options().formulation == Formulation::spline) v.item[kConstraint2] = 0;
    v.item[kMultiplier] = folded<Largest>(items_.data() + kMultiplier * n, n);
    seconds_.solve += watch_.lap();
    return v;
  }

  PointValues try_step(double ct, double cn) {
    watch_.lap();
    const StepRows rows = step_rows();
    double* step = trial().step.data();
    for_nodes([&](long begin, long end) { kernels_.compose_step(rows, begin, end, ct, cn, step); });
    return evaluate();
  }

  PointValues try_correction(double zeta) {
    watch_.lap();
    const Trial& before = trial();
    at_ = 1 - at_;
    const StepRows rows = step_rows();
    for_nodes([&](long begin, long end) {
      kernels_.write_correction_rhs(rows, begin, end, zeta, before.point.constraint.data(),
                                    correction_.data());
    });
    std::fill(correction_.begin() + kkt_.offset(kkt_.nodes()), correction_.end(), 0.0);
    kkt_.solve(correction_, 1, 0);  // a correction need not be exact
    double* corrected = trial().step.data();
    for_nodes([&](long begin, long end) {
      kernels_.add_correction(rows, begin, end, correction_.data(), before.step.data(), corrected);
    });
    seconds_.solve += watch_.lap();
    return evaluate();
  }

  StepRows step_rows() {
    return kkt_.step_rows(lin_.node_gradient.data(), current_.constraint.data(), solution_.data());
  }

  // body(begin, end) over chunks of nodes.
  template <class Body>
  void for_nodes(const Body& body) const {
    const long n = kkt_.nodes();
    parallel_for(tree_chunks(n), problem_.options().threads, [&](long chunk, int) {
      body(chunk * kTreeWidth, std::min(chunk * kTreeWidth + kTreeWidth, n));
    });
  }

  PointValues evaluate() {
    Trial& t = trial();
    problem_.retract(state_, t.step.data(), t.state);
    problem_.evaluate(t.state, t.point);
    seconds_.dynamics += watch_.lap();
    return values(t.point);
  }

  static PointValues values(const Evaluation& e) {
    return {e.objective, e.constraint_norm, e.frame_violation};
  }

  TrajectoryProblem& problem_;
  const ExecutorOptions options_;
  const NodeKernels& kernels_;
  KktSystem kkt_;
  State& state_;
  Evaluation current_;
  Linearization lin_;
  std::vector<double> solution_;    // (rows, 2): right-hand sides, then t and n
  std::vector<double> correction_;  // rows
  std::vector<double> items_;       // kStepItems x nodes
  Trial trials_[2];                 // the trial and the one before the last correction
  int at_ = 0;
  Stopwatch watch_;
  PhaseSeconds seconds_;
  std::string error_;
};

}  // namespace

std::unique_ptr<SqpExecutor> make_cpu_executor(TrajectoryProblem& problem,
                                               const ExecutorOptions& options, State& state) {
  return std::make_unique<CpuExecutor>(problem, options, state);
}

}  // namespace trajopt
