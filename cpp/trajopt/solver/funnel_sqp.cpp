#include "trajopt/solver/funnel_sqp.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>

#include "trajopt/base/error.h"
#include "trajopt/solver/stopwatch.h"

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

class FunnelSolver {
 public:
  FunnelSolver(TrajectoryProblem& problem, const FunnelOptions& options, State& state,
               const Observer& observer)
      : problem_(problem),
        options_(options),
        state_(state),
        observer_(observer),
        kkt_(problem, options.smoothing, options.ordering),
        funnel_(options.funnel),
        narrow_(options.funnel),
        damping_(options.damping),
        normal_radius_(options.normal_radius) {}

  Result run() {
    linearize();
    if (!std::isfinite(current_.objective) || !std::isfinite(current_.frame_violation)) {
      return {Status::numerical_failure, "the initial guess gives values that are not finite", 0};
    }
    funnel_ = std::max(funnel_, 1.25 * current_.constraint_norm);
    for (int round = 0;; ++round) {
      const bool settled = descend();
      if (stop_) return *stop_;
      if (!options_.restore) return conclude(settled);
      const double before = current_.objective;
      restore();
      if (stop_) return *stop_;
      // Restoring physics may cost objective; if it did, go on from there in a narrow funnel.
      const bool kept = current_.objective - before <= options_.objective_tolerance * before;
      if (kept || !settled || round == kMaxRounds || iteration_ >= options_.max_iterations) {
        return conclude(settled);
      }
      history_.clear();
      narrow_ = funnel_ = floor();
      damping_ = std::max(damping_, options_.damping);
    }
  }

 private:
  void linearize() {
    problem_.linearize(state_, options_.augmentation, current_, lin_);
    pending_.dynamics += watch_.lap();
  }

  // Steps until the objective has settled (true) or the limit is reached.
  bool descend() {
    while (iteration_ < options_.max_iterations && damping_ < kMaxDamping) {
      begin_record();
      if (!step()) {
        stop_ = failure();
        return false;
      }
      if (!report()) return false;
      if (has_settled()) return true;
    }
    return false;
  }

  void begin_record() {
    record_ = {};
    record_.seconds = pending_;
    pending_ = {};
  }

  // Factors K at the current damping; raises it while the matrix has the wrong inertia.
  bool factor() {
    for (int attempt = 0; attempt < 8; ++attempt) {
      kkt_.assemble(lin_, damping_);
      record_.seconds.assembly += watch_.lap();
      try {
        kkt_.factor(options_.epsilon);
        record_.seconds.factorization += watch_.lap();
        return true;
      } catch (const FactorizationError& error) {
        record_.seconds.factorization += watch_.lap();
        factor_error_ = error.what();
        damping_ = std::max(10 * damping_, 1e-8);
      }
    }
    return false;
  }

  // Columns: tangential step t (A t = 0) and normal step n (A n = -C).
  void solve_steps() {
    rhs_.assign(2 * kkt_.rows(), 0.0);
    for (int i = 0; i < kkt_.nodes(); ++i) {
      const long at = kkt_.offset(i);
      for (int k = 0; k < kkt_.dual(); ++k)
        rhs_[2 * (at + k) + 1] = -current_.constraint[static_cast<long>(i) * kkt_.dual() + k];
      for (int k = 0; k < kkt_.primal(); ++k)
        rhs_[2 * (at + kkt_.dual() + k)] =
            -lin_.node_gradient[static_cast<long>(i) * kkt_.primal() + k];
    }
    kkt_.solve(rhs_, 2);
    multiplier_ = 0;
    for (int i = 0; i < kkt_.nodes(); ++i)
      for (int k = 0; k < kkt_.dual(); ++k) {
        const long at = 2 * (kkt_.offset(i) + k);
        multiplier_ = std::max(multiplier_, std::abs(rhs_[at] + rhs_[at + 1]));
      }
    tangential_.resize(kkt_.rows());
    normal_.resize(kkt_.rows());
    for (long r = 0; r < kkt_.rows(); ++r) {
      tangential_[r] = rhs_[2 * r];
      normal_[r] = rhs_[2 * r + 1];
    }
    record_.seconds.solve += watch_.lap();
  }

  std::vector<double> tangent(const std::vector<double>& v) const {
    std::vector<double> out(static_cast<std::size_t>(kkt_.nodes()) * kkt_.primal());
    for (int i = 0; i < kkt_.nodes(); ++i)
      std::copy_n(v.begin() + kkt_.offset(i) + kkt_.dual(), kkt_.primal(),
                  out.begin() + static_cast<long>(i) * kkt_.primal());
    return out;
  }

  // Decrease of g.d + d.H d / 2 along d; `shortfall`: A d = -shortfall * C.
  double predicted_decrease(const std::vector<double>& d, double shortfall) {
    std::vector<double> x(d);
    for (int i = 0; i < kkt_.nodes(); ++i) {  // multipliers off; padding is zero in d already
      std::fill_n(x.begin() + kkt_.offset(i), kkt_.dual(), 0.0);
    }
    kkt_.multiply(x, product_);
    double quadratic = 0, linear = 0;
    for (int i = 0; i < kkt_.nodes(); ++i) {
      const long at = kkt_.offset(i) + kkt_.dual();
      for (int k = 0; k < kkt_.primal(); ++k) {
        quadratic += x[at + k] * product_[at + k];
        linear += x[at + k] * lin_.node_gradient[static_cast<long>(i) * kkt_.primal() + k];
      }
    }
    double augmented = 0;
    if (problem_.options().formulation == Formulation::frames) {
      for (double c : current_.constraint) augmented += c * c;
      augmented *= options_.augmentation * shortfall * shortfall;
    }
    quadratic -= damping_ * kkt_.metric_norm2(x) + augmented;
    return -(linear + 0.5 * quadratic);
  }

  bool trial(const std::vector<double>& d) {
    problem_.retract(state_, tangent(d).data(), trial_state_);
    problem_.evaluate(trial_state_, trial_);
    record_.seconds.dynamics += watch_.lap();
    return std::isfinite(trial_.objective) && std::isfinite(trial_.constraint_norm);
  }

  // d += K^-1 [.; -(C(x + d) - (1 - zeta) C)] with the factorization at hand.
  void correct(std::vector<double>& d, double zeta) {
    rhs_.assign(kkt_.rows(), 0.0);
    for (int i = 0; i < kkt_.nodes(); ++i)
      for (int k = 0; k < kkt_.dual(); ++k) {
        const long c = static_cast<long>(i) * kkt_.dual() + k;
        rhs_[kkt_.offset(i) + k] = -(trial_.constraint[c] - (1 - zeta) * current_.constraint[c]);
      }
    kkt_.solve(rhs_, 1, 0);  // a correction need not be exact
    for (long r = 0; r < kkt_.rows(); ++r) d[r] += rhs_[r];
    record_.seconds.solve += watch_.lap();
  }

  // One iteration: a step at the current linearization, accepted or not.
  bool step() {
    if (!factor()) return false;
    solve_steps();
    const double normal_length = std::sqrt(kkt_.metric_norm2(normal_));
    const double zeta = normal_length > normal_radius_ ? normal_radius_ / normal_length : 1.0;
    std::vector<double> d(tangential_);
    for (long r = 0; r < kkt_.rows(); ++r) d[r] += zeta * normal_[r];
    record_.step_norm = std::sqrt(kkt_.metric_norm2(d));
    const double tangential_decrease = predicted_decrease(tangential_, 0.0);
    const double predicted = predicted_decrease(d, zeta);
    bool finite = trial(d);
    for (int k = 0; finite && k < options_.corrections; ++k) {
      if (trial_.constraint_norm <= 0.1 * options_.constraint_tolerance) break;
      std::swap(best_trial_, trial_);
      std::swap(best_state_, trial_state_);
      std::vector<double> corrected(d);
      trial_.constraint = best_trial_.constraint;
      correct(corrected, zeta);
      finite = trial(corrected);
      if (!finite || trial_.constraint_norm > best_trial_.constraint_norm) {
        std::swap(best_trial_, trial_);
        std::swap(best_state_, trial_state_);
        finite = true;
        break;
      }
      d = std::move(corrected);
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
      state_ = trial_state_;
      linearize();
      // A funnel opened for a bad start closes behind the iterates.
      funnel_ = std::max(std::min(funnel_, 1.25 * current_.constraint_norm), narrow_);
      normal_radius_ = std::min(2 * normal_radius_, options_.normal_radius);
    } else {
      // Damping shortens the tangential part only: a normal step that dominates is cut here.
      if (2 * zeta * normal_length > record_.step_norm) normal_radius_ = 0.5 * zeta * normal_length;
      damping_ = std::min(damping_ * growth_, kMaxDamping);
      growth_ *= 2;
    }
    return true;
  }

  // Is the trial good enough? Sets the gain ratio that steers the damping.
  bool accept(double predicted, double tangential, double zeta) {
    const double actual = current_.objective - trial_.objective;
    const double violation = current_.constraint_norm;
    const double restored = violation - trial_.constraint_norm;
    if (predicted >= kObjectiveShare * tangential) {
      record_.gain_ratio = predicted > 0 ? actual / predicted : 0;
      if (trial_.constraint_norm <= funnel_ && actual > 0 && record_.gain_ratio > kAccept)
        return true;
    } else if (restored >= kRestore * zeta * violation) {
      record_.gain_ratio = restored / (zeta * violation);
      funnel_ = std::min(funnel_, std::max({0.9 * funnel_, violation - 0.5 * restored, floor()}));
      return true;
    }
    // Neither alone: the two together, weighed by the multipliers.
    const double weight = kMeritFactor * multiplier_;
    const double merit = actual + weight * restored;
    const double expected = std::max(predicted, 0.0) + weight * zeta * violation;
    if (restored < kRestore * zeta * violation || merit < kMeritShare * expected) return false;
    record_.gain_ratio = merit / expected;
    return true;
  }

  double floor() const { return std::max(10 * options_.constraint_tolerance, 1e-4); }

  // Hands the record to the observer; false: stop, with stop_ set.
  bool report() {
    record_.iteration = iteration_++;
    record_.objective = current_.objective;
    record_.terms = current_.terms;
    record_.constraint_norm = current_.constraint_norm;
    record_.frame_violation = current_.frame_violation;
    record_.penalty = funnel_;
    record_.elapsed = watch_.total();
    if (!observer_ || observer_(record_, state_)) return true;
    stop_ = {Status::interrupted,
             format("stopped on request; objective %.6g, |C| = %.2e body weights",
                    current_.objective, current_.constraint_norm),
             iteration_};
    return false;
  }

  // Has the objective stopped falling? With physics still loose, narrows the funnel first.
  bool has_settled() {
    if (flat_) return true;
    if (!record_.accepted) return false;
    history_.push_back(current_.objective);
    const int window = options_.window;
    if (static_cast<int>(history_.size()) <= window) return false;
    const double before = history_[history_.size() - 1 - window];
    const double change = options_.objective_tolerance * std::abs(before);
    if (before - current_.objective > change) return false;
    if (current_.objective - before > change) {  // physics was restored at its expense: go on
      history_.clear();
      return false;
    }
    if (current_.constraint_norm <= floor()) return true;
    narrow_ = funnel_ = std::max(std::min(0.3 * funnel_, 0.5 * current_.constraint_norm), floor());
    history_.clear();
    return false;
  }

  // Newton steps on the constraints alone, shortest in the metric W.
  void restore() {
    const double kept = damping_;
    damping_ = options_.damping;
    double limit = options_.normal_radius;
    for (int k = 0; k < kMaxRestorations; ++k) {
      if (current_.constraint_norm <= options_.constraint_tolerance) break;
      begin_record();
      if (!factor()) {
        stop_ = failure();
        return;
      }
      solve_steps();
      const double length = std::sqrt(kkt_.metric_norm2(normal_));
      const double zeta = std::min(1.0, limit / std::max(length, 1e-300));
      std::vector<double> d(normal_);
      for (double& v : d) v *= zeta;
      bool finite = trial(d);
      for (int c = 0; finite && c < options_.corrections; ++c) {
        correct(d, zeta);
        finite = trial(d);
      }
      record_.step_norm = zeta * length;
      record_.damping = damping_;
      record_.accepted =
          finite && trial_.constraint_norm < (1 - kRestore * zeta) * current_.constraint_norm;
      if (record_.accepted) {
        state_ = trial_state_;
        linearize();
        limit = std::min(2 * limit, options_.normal_radius);
      } else {
        limit = 0.25 * zeta * length;
        damping_ *= 10;
      }
      if (!report()) return;
      if (damping_ > kMaxRestorationDamping * options_.damping) break;
    }
    damping_ = kept;
  }

  Result conclude(bool settled) const {
    const double c = current_.constraint_norm, tolerance = options_.constraint_tolerance;
    if (options_.restore && c > tolerance) {
      return {Status::stalled,
              format("restoration ended at |C| = %.2e body weights, above the tolerance %.1e "
                     "(objective %.6g)",
                     c, tolerance, current_.objective),
              iteration_};
    }
    if (settled) {
      return {
          Status::solved,
          format("objective %.6g fell by less than %.1e (relative) in %d iterations; |C| = "
                 "%.2e <= %.1e body weights",
                 current_.objective, options_.objective_tolerance, options_.window, c, tolerance),
          iteration_};
    }
    if (damping_ >= kMaxDamping) {
      return {Status::stalled,
              format("no step lowers the objective %.6g any more (damping %.1e)",
                     current_.objective, damping_),
              iteration_};
    }
    return {Status::max_iterations,
            format("iteration limit reached; objective %.6g, |C| = %.2e body weights",
                   current_.objective, c),
            iteration_};
  }

  Result failure() const {
    return {
        Status::numerical_failure,
        format("the KKT matrix could not be factored at damping %.1e: ", damping_) + factor_error_,
        iteration_};
  }

  TrajectoryProblem& problem_;
  const FunnelOptions options_;
  State& state_;
  const Observer& observer_;
  KktSystem kkt_;
  Stopwatch watch_;
  double funnel_, narrow_, damping_, normal_radius_, growth_ = 2, multiplier_ = 0;
  Evaluation current_, trial_, best_trial_;
  State trial_state_, best_state_;
  Linearization lin_;
  std::vector<double> rhs_, tangential_, normal_, product_, history_;
  IterationRecord record_;
  PhaseSeconds pending_;
  std::string factor_error_;
  std::optional<Result> stop_;
  int iteration_ = 0;
  bool flat_ = false;
};

}  // namespace

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

Result solve_funnel(TrajectoryProblem& problem, const FunnelOptions& options, State& state,
                    const Observer& observer) {
  return FunnelSolver(problem, options, state, observer).run();
}

}  // namespace trajopt
