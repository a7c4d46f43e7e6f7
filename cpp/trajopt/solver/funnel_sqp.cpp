#include "trajopt/solver/funnel_sqp.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "trajopt/solver/funnel.h"

namespace trajopt {

namespace {

constexpr double kMinDamping = 1e-12, kMaxDamping = 1e12;
constexpr double kAccept = 0.05;         // least actual / predicted decrease
constexpr double kObjectiveShare = 0.1;  // of the tangential decrease: below it a step is restoring
constexpr double kRestore = 0.1;         // least relative decrease of |C| by a restoring step
constexpr int kMaxRestorations = 30;
constexpr double kMaxRestorationDamping = 1e8;
constexpr double kShrink = 0.5;     // of the damping after the best of steps
constexpr double kFlat = 1e-2;      // share of the tolerance a single step may be short of
constexpr double kMeritFactor = 2;  // weight of |C|_inf over the largest multiplier
constexpr double kMeritShare = 0.1;
constexpr int kMaxRounds = 3;  // of descent and restoration

template <class... Args>
std::string format(const char* text, Args... args) {
  char buffer[400];
  std::snprintf(buffer, sizeof buffer, text, args...);
  return buffer;
}

}  // namespace

Funnel::Funnel(SqpPoint& point, const FunnelOptions& options, Report report)
    : point_(point),
      options_(options),
      report_(std::move(report)),
      funnel_(options.funnel),
      narrow_(options.funnel),
      damping_(options.damping),
      normal_radius_(options.normal_radius),
      recent_(static_cast<std::size_t>(std::max(options.window, 0)) + 1) {}

const Request& Funnel::begin() {
  run_.emplace(run());
  run_->start();
  return next();
}

const Request& Funnel::resume(const Answer& answer) {
  answer_ = answer;
  asker_.resume();
  return next();
}

const Request& Funnel::next() {
  if (run_->done()) {
    result_ = run_->result();
    result_->ordering = point_.ordering();
    request_ = {};
  }
  return request_;
}

Task<Result> Funnel::run() {
  current_ = (co_await ask({.kind = Request::Kind::linearize})).point;
  if (!current_.finite()) {
    co_return Result{Status::numerical_failure,
                     "the initial guess gives values that are not finite", 0};
  }
  funnel_ = std::max(funnel_, 1.25 * current_.constraint_norm);
  for (int round = 0;; ++round) {
    const bool settled = co_await descend();
    if (stop_) co_return *stop_;
    if (!options_.restore) co_return conclude(settled);
    const double before = current_.objective;
    co_await restore();
    if (stop_) co_return *stop_;
    // Restoring physics may cost objective; if it did, go on from there in a narrow funnel.
    const bool kept = current_.objective - before <= options_.objective_tolerance * before;
    if (kept || !settled || round == kMaxRounds || iteration_ >= options_.max_iterations) {
      co_return conclude(settled);
    }
    fallen_ = 0;
    narrow_ = funnel_ = floor();
    damping_ = std::max(damping_, options_.damping);
  }
}

// Steps until the objective has settled (true) or the limit is reached.
Task<bool> Funnel::descend() {
  while (iteration_ < options_.max_iterations && damping_ < kMaxDamping) {
    const bool stepped = co_await step();
    if (!stepped) {
      stop_ = failure();
      co_return false;
    }
    if (!report()) co_return false;
    if (has_settled()) co_return true;
  }
  co_return false;
}

// Factors K at the current damping, which is raised while the matrix has the wrong inertia, and
// solves for the steps.
Task<bool> Funnel::solve_steps() {
  for (int attempt = 0; attempt < 8; ++attempt) {
    const Answer& answer = co_await ask({.kind = Request::Kind::steps, .damping = damping_});
    if (answer.factored) {
      steps_ = answer.steps;
      co_return true;
    }
    damping_ = std::max(10 * damping_, 1e-8);
  }
  co_return false;
}

double Funnel::predicted_decrease(double ct, double cn) const {
  return steps_.predicted_decrease(ct, cn, damping_, options_.augmentation);
}

// One iteration: a step at the current linearization, accepted or not.
Task<bool> Funnel::step() {
  const bool solved = co_await solve_steps();
  if (!solved) co_return false;
  record_.gain_ratio = 0;
  const double normal_length = steps_.norm(0, 1);
  const double zeta = normal_length > normal_radius_ ? normal_radius_ / normal_length : 1.0;
  record_.step_norm = steps_.norm(1, zeta);
  const double tangential_decrease = predicted_decrease(1, 0);
  const double predicted = predicted_decrease(1, zeta);
  trial_ = (co_await try_step(1, zeta)).point;
  const bool finite = trial_.finite();
  for (int k = 0; finite && k < options_.corrections; ++k) {
    if (trial_.constraint_norm <= 0.1 * options_.constraint_tolerance) break;
    const PointValues corrected = (co_await try_correction(zeta)).point;
    if (!corrected.finite() || corrected.constraint_norm > trial_.constraint_norm) {
      point_.undo_correction();
      break;
    }
    trial_ = corrected;
  }

  // At the optimum nothing is left to gain, and what differs is rounding: no step is acceptable.
  flat_ =
      finite && damping_ <= options_.damping && current_.constraint_norm <= floor() &&
      tangential_decrease <= kFlat * options_.objective_tolerance * std::abs(current_.objective);
  const bool accepted = finite && accept(predicted, tangential_decrease, zeta);
  record_.accepted = accepted;
  record_.damping = damping_;
  if (accepted) {
    const double rho = std::min(record_.gain_ratio, 1.0);
    const double cube = (2 * rho - 1) * (2 * rho - 1) * (2 * rho - 1);
    damping_ = std::max(damping_ * std::max(kShrink, 1 - cube), kMinDamping);
    growth_ = 2;
    co_await move();
    // A funnel opened for a bad start closes behind the iterates.
    funnel_ = std::max(std::min(funnel_, 1.25 * current_.constraint_norm), narrow_);
    normal_radius_ = std::min(2 * normal_radius_, options_.normal_radius);
  } else {
    // Damping shortens the tangential part only: a normal step that dominates is cut here.
    if (2 * zeta * normal_length > record_.step_norm) normal_radius_ = 0.5 * zeta * normal_length;
    damping_ = std::min(damping_ * growth_, kMaxDamping);
    growth_ *= 2;
  }
  co_return true;
}

// To the trial. The time of its linearization belongs to the next iteration.
Task<bool> Funnel::move() {
  record_.seconds = point_.take_seconds();
  current_ = (co_await ask({.kind = Request::Kind::move})).point;
  co_return true;
}

// Is the trial good enough? Sets the gain ratio that steers the damping.
bool Funnel::accept(double predicted, double tangential, double zeta) {
  const double actual = current_.objective - trial_.objective;
  const double violation = current_.constraint_norm;
  const double restored = violation - trial_.constraint_norm;
  if (predicted >= kObjectiveShare * tangential) {
    record_.gain_ratio = predicted > 0 ? actual / predicted : 0;
    if (trial_.constraint_norm <= funnel_ && actual > 0 && record_.gain_ratio > kAccept)
      return true;
  } else if (restored > 0 && restored >= kRestore * zeta * violation) {
    record_.gain_ratio = restored / (zeta * violation);
    funnel_ = std::min(funnel_, std::max({0.9 * funnel_, violation - 0.5 * restored, floor()}));
    return true;
  }
  // Neither alone: the two together, weighed by the multipliers.
  const double weight = kMeritFactor * steps_.item[kMultiplier];
  const double merit = actual + weight * restored;
  const double expected = std::max(predicted, 0.0) + weight * zeta * violation;
  if (expected <= 0 || restored < kRestore * zeta * violation || merit < kMeritShare * expected)
    return false;
  record_.gain_ratio = merit / expected;
  return true;
}

double Funnel::floor() const { return std::max(10 * options_.constraint_tolerance, 1e-4); }

// Hands the record to the observer; false: stop, with stop_ set.
bool Funnel::report() {
  if (!record_.accepted) record_.seconds = point_.take_seconds();
  record_.iteration = iteration_++;
  record_.objective = current_.objective;
  record_.terms = point_.terms();
  record_.constraint_norm = current_.constraint_norm;
  record_.frame_violation = current_.frame_violation;
  record_.penalty = funnel_;
  record_.elapsed = watch_.total();
  record_.ordering = point_.ordering();
  if (!report_ || report_(record_, point_)) return true;
  stop_ = {Status::interrupted,
           format("stopped on request; objective %.6g, |C| = %.2e body weights", current_.objective,
                  current_.constraint_norm),
           iteration_};
  return false;
}

// Has the objective stopped falling? With physics still loose, narrows the funnel first.
bool Funnel::has_settled() {
  if (flat_) return true;
  if (!record_.accepted) return false;
  recent_[fallen_++ % recent_.size()] = current_.objective;
  if (fallen_ < recent_.size()) return false;
  const double before = recent_[fallen_ % recent_.size()];
  const double change = options_.objective_tolerance * std::abs(before);
  if (before - current_.objective > change) return false;
  if (current_.objective - before > change) {  // physics was restored at its expense: go on
    fallen_ = 0;
    return false;
  }
  if (current_.constraint_norm <= floor()) return true;
  narrow_ = funnel_ = std::max(std::min(0.3 * funnel_, 0.5 * current_.constraint_norm), floor());
  fallen_ = 0;
  return false;
}

// Newton steps on the constraints alone, shortest in the metric W.
Task<bool> Funnel::restore() {
  const double kept = damping_;
  damping_ = options_.damping;
  double limit = options_.normal_radius;
  for (int k = 0; k < kMaxRestorations; ++k) {
    if (current_.constraint_norm <= options_.constraint_tolerance) break;
    const bool solved = co_await solve_steps();
    if (!solved) {
      stop_ = failure();
      co_return false;
    }
    const double length = steps_.norm(0, 1);
    const double zeta = std::min(1.0, limit / std::max(length, 1e-300));
    trial_ = (co_await try_step(0, zeta)).point;
    for (int c = 0; trial_.finite() && c < options_.corrections; ++c)
      trial_ = (co_await try_correction(zeta)).point;
    record_.gain_ratio = 0;
    record_.step_norm = zeta * length;
    record_.damping = damping_;
    record_.accepted = trial_.finite() &&
                       trial_.constraint_norm < (1 - kRestore * zeta) * current_.constraint_norm;
    if (record_.accepted) {
      co_await move();
      limit = std::min(2 * limit, options_.normal_radius);
    } else {
      limit = 0.25 * zeta * length;
      damping_ *= 10;
    }
    if (!report()) co_return false;
    if (damping_ > kMaxRestorationDamping * options_.damping) break;
  }
  damping_ = kept;
  co_return true;
}

Result Funnel::conclude(bool settled) const {
  const double c = current_.constraint_norm, tolerance = options_.constraint_tolerance;
  if (options_.restore && c > tolerance) {
    return {Status::stalled,
            format("restoration ended at |C| = %.2e body weights, above the tolerance %.1e "
                   "(objective %.6g)",
                   c, tolerance, current_.objective),
            iteration_};
  }
  if (settled) {
    return {Status::solved,
            format("objective %.6g fell by less than %.1e (relative) in %d iterations; |C| = "
                   "%.2e <= %.1e body weights",
                   current_.objective, options_.objective_tolerance, options_.window, c, tolerance),
            iteration_};
  }
  if (damping_ >= kMaxDamping) {
    return {Status::stalled,
            format("no step lowers the objective %.6g any more (damping %.1e)", current_.objective,
                   damping_),
            iteration_};
  }
  return {Status::max_iterations,
          format("iteration limit reached; objective %.6g, |C| = %.2e body weights",
                 current_.objective, c),
          iteration_};
}

Result Funnel::failure() const {
  return {
      Status::numerical_failure,
      format("the KKT matrix could not be factored at damping %.1e: ", damping_) + point_.error(),
      iteration_};
}

const char* status_name(Status status) {
  switch (status) {
    case Status::solved:
      return "solved";
    case Status::max_iterations:
      return "max_iterations";
    case Status::stalled:
      return "stalled";
    case Status::interrupted:
      return "interrupted";
    case Status::infeasible:
      return "infeasible";
    default:
      return "numerical_failure";
  }
}

Result run_funnel(SqpExecutor& executor, const FunnelOptions& options, Report report) {
  Funnel funnel(executor, options, std::move(report));
  const Request* request = &funnel.begin();
  while (request->kind != Request::Kind::nothing)
    request = &funnel.resume(executor.answer(*request));
  executor.state();  // an executor on a device may not have fetched the last one yet
  return funnel.result();
}

Report report_to(Observer observer) {
  if (!observer) return {};
  return [observe = std::move(observer)](const IterationRecord& record, SqpPoint& point) {
    return observe(record, point.state());
  };
}

Result solve_funnel(TrajectoryProblem& problem, const FunnelOptions& options, State& state,
                    const Observer& observer) {
  const auto executor = make_cpu_executor(problem, executor_options(options), state);
  return run_funnel(*executor, options, report_to(observer));
}

}  // namespace trajopt
