#include "trajopt/solver/paper_sqp.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "trajopt/base/error.h"
#include "trajopt/linalg/conjugate_gradient.h"
#include "trajopt/solver/disc.h"
#include "trajopt/solver/stopwatch.h"

namespace trajopt {

namespace {

using linalg::dot;
using Vector = std::vector<double>;  // nodes x (multipliers, tangent), as KktSystem lays it out

template <class... Args>
std::string format(const char* text, Args... args) {
  char buffer[400];
  std::snprintf(buffer, sizeof buffer, text, args...);
  return buffer;
}

constexpr double kLargestRadius = 1e100;  // Newton steps may be taken for ever

double length(const Vector& x) { return std::sqrt(dot(x, x)); }

void add(double scale, const Vector& x, Vector& y) {
  for (std::size_t i = 0; i < x.size(); ++i) y[i] = std::fma(scale, x[i], y[i]);
}

// A step d, and the constraint C0 + A d it aims at: zero unless C0 had to be adjusted.
struct Step {
  Vector d, remaining;
  bool adjusted = false;
};

class PaperSolver {
 public:
  PaperSolver(TrajectoryProblem& problem, const PaperOptions& options, State& state,
              const Observer& observer)
      : problem_(problem),
        options_(options),
        state_(state),
        observer_(observer),
        newton_(problem, 0.0, options.ordering),
        projection_(problem, 0.0, options.ordering),
        penalty_(options.penalty) {
    if (options.ordering == linalg::Ordering::frontal)
      throw ArgumentError("ordering = 'frontal': method 'paper' works on blocks");
  }

  Result run() {
    Result result = search();
    result.ordering = newton_.ordering();
    return result;
  }

 private:
  Result search() {
    linearize();
    first_violation_ = current_.constraint_norm;
    if (!std::isfinite(current_.objective) || !std::isfinite(current_.frame_violation)) {
      return {Status::numerical_failure, "the initial guess gives values that are not finite", 0};
    }
    for (int iteration = 0; iteration < options_.max_iterations; ++iteration) {
      record_ = {};
      record_.seconds = pending_;
      pending_ = {};
      if (!iterate()) return failure(iteration);
      if (!report(iteration)) return interrupted(iteration + 1);
      if (converged()) return solved(iteration + 1);
      if (radius_ < options_.smallest_radius) return stalled(iteration + 1);
    }
    return {Status::max_iterations,
            format("%d iterations done; objective %.6g, |C| = %.2e, last step %.2e",
                   options_.max_iterations, current_.objective, current_.constraint_norm,
                   step_norm_inf_),
            options_.max_iterations};
  }

  // Line 3. A rejected step leaves the linearization, and its factorizations, as they are.
  void linearize() {
    problem_.linearize(state_, 0.0, current_, lin_);
    gradient_ = interleave(lin_.node_gradient, {});
    constraint_ = interleave({}, current_.constraint);
    factored_ = projected_ = false;
    pending_.dynamics += watch_.lap();
  }

  // Lines 4 to 17.
  bool iterate() {
    Step step;
    if (!solve_subproblem(step)) return false;
    update_penalty(step);
    const double step_length = length(step.d);
    if (std::isinf(radius_)) radius_ = step_length;

    problem_.retract(state_, tangent(step.d).data(), trial_state_);
    problem_.evaluate(trial_state_, trial_);
    record_.seconds.dynamics += watch_.lap();
    const double before = merit(current_), after = merit(trial_);
    record_.accepted = after < before && trial_.constraint_norm < options_.constraint_limit;
    record_.gain_ratio = (before - after) / predicted_decrease(step);
    record_.radius = radius_;
    record_.step_norm = step_length;
    record_.penalty = penalty_;
    record_.damping = damping_;
    step_norm_inf_ = 0;
    for (double value : step.d) step_norm_inf_ = std::max(step_norm_inf_, std::abs(value));
    if (record_.accepted) {
      ++accepted_;
      state_ = trial_state_;
      radius_ = std::min(options_.growth * radius_, kLargestRadius);
      linearize();
    } else {
      radius_ = options_.shrink * step_length;
    }
    return true;
  }

  // Equation 10. False when no factorization exists.
  bool solve_subproblem(Step& step) {
    if (!factored_ && !factor_newton()) return false;
    step.d = newton_step_;
    step.remaining.assign(constraint_.size(), 0.0);
    if (length(newton_step_) <= radius_) return true;
    if (!projected_ && !factor_projection()) return false;

    // Normal part: the shortest step to A d = -C0, or where that is too long (line 5) the best of
    // the admissible length. The Newton direction is its tangential rest.
    Vector normal = shortest_step_, first = newton_step_;
    const double room = options_.normal_share * radius_;
    if (length(shortest_step_) > room) {
      step.adjusted = true;
      normal = least_squares_step(room);
      const Vector image = constraint_image(normal);
      step.remaining = constraint_;
      add(1.0, image, step.remaining);
      Vector rhs = image;
      add(-1.0, gradient_, rhs);
      first = solve(newton_, rhs);
    }
    add(-1.0, normal, first);

    // Second direction: steepest descent of the model at the normal part, kept on A d = 0.
    Vector slope = hessian_times(normal);
    add(1.0, gradient_, slope);
    Vector second(slope.size(), 0.0);
    add(-1.0, slope, second);
    second = solve(projection_, second);

    const double left = std::sqrt(std::max(radius_ * radius_ - dot(normal, normal), 0.0));
    step.d = std::move(normal);
    add_best_combination(first, second, slope, left, step.d);
    record_.seconds.solve += watch_.lap();
    return true;
  }

  // d += the minimizer of slope.t + t.H t / 2 over t in span(u, v), |t| <= radius.
  void add_best_combination(Vector u, Vector v, const Vector& slope, double radius,
                            Vector& d) const {
    const auto normalize = [](Vector& x, double reference) {
      const double norm = length(x);
      const bool usable = norm > 1e-12 * reference && norm > 1e-300;
      for (double& value : x) value = usable ? value / norm : 0.0;
    };
    normalize(u, 0.0);
    const double whole = length(v);
    for (int twice = 0; twice < 2; ++twice) add(-dot(u, v), u, v);
    normalize(v, whole);
    const Vector hu = hessian_times(u), hv = hessian_times(v);
    const auto y =
        minimize_in_disc(dot(u, hu), dot(u, hv), dot(v, hv), dot(u, slope), dot(v, slope), radius);
    add(y[0], u, d);
    add(y[1], v, d);
  }

  // min |A d + C0|^2 over |d| <= room by conjugate gradients.
  Vector least_squares_step(double room) {
    Vector x(constraint_.size());
    linalg::least_squares_in_ball(
        [this](const Vector& in, Vector& out) { out = constraint_image(in); },
        [this](const Vector& in, Vector& out) { out = constraint_transposed(in); }, constraint_,
        room, options_.conjugate_gradient_steps, 1e-10, x);
    return x;
  }

  // Equation 11: the merit's model must fall. Where C0 was adjusted, |C|^2 / 2 falls by less.
  void update_penalty(const Step& step) {
    const double fall = constraint_decrease(step);
    if (fall > 0) penalty_ = std::max(penalty_, model_change(step.d) / fall);
  }
  double constraint_decrease(const Step& step) const {
    return 0.5 * (dot(constraint_, constraint_) - dot(step.remaining, step.remaining));
  }
  double model_change(const Vector& d) const {
    return dot(gradient_, d) + 0.5 * dot(d, hessian_times(d));
  }
  double predicted_decrease(const Step& step) const {
    return penalty_ * constraint_decrease(step) - model_change(step.d);
  }
  double merit(const Evaluation& e) const {
    double sum = 0;
    for (double c : e.constraint) sum = std::fma(c, c, sum);
    const double value = 0.5 * penalty_ * sum + e.objective;
    return std::isnan(value) ? HUGE_VAL : value;
  }

  // ---- linear algebra
  // ----------------------------------------------------------------------------

  bool factor_newton() {
    double largest = 0;
    const long d = problem_.model().ndof;
    for (std::size_t at = 0; at < lin_.hessian.size(); at += 6 * d * d)
      for (int block : {0, 3, 5})
        for (long k = 0; k < d; ++k)
          largest = std::max(largest, lin_.hessian[at + (block * d + k) * d + k]);
    damping_ = options_.damping * std::max(largest, 1e-300);
    for (int attempt = 0; attempt < 8; ++attempt, damping_ *= 10) {
      newton_.assemble(lin_, damping_);
      record_.seconds.assembly += watch_.lap();
      if (!factor(newton_)) continue;
      Vector rhs(constraint_.size(), 0.0);
      add(-1.0, gradient_, rhs);
      add(-1.0, constraint_, rhs);
      newton_step_ = solve(newton_, rhs);
      if (!std::isfinite(dot(newton_step_, newton_step_))) continue;
      factored_ = true;
      return true;
    }
    return false;
  }

  bool factor_projection() {
    projection_.assemble(lin_, 1.0, true);
    record_.seconds.assembly += watch_.lap();
    if (!factor(projection_)) return false;
    Vector rhs(constraint_.size(), 0.0);
    add(-1.0, constraint_, rhs);
    shortest_step_ = solve(projection_, rhs);
    projected_ = true;
    return true;
  }

  bool factor(KktSystem& system) {
    bool done = true;
    try {
      system.factor(options_.epsilon);
    } catch (const FactorizationError& error) {
      factor_error_ = error.what();
      done = false;
    }
    record_.seconds.factorization += watch_.lap();
    return done;
  }

  // Tangent part of the solution.
  Vector solve(KktSystem& system, Vector rhs) {
    system.solve(rhs, 1);
    clear_multipliers(rhs);
    record_.seconds.solve += watch_.lap();
    return rhs;
  }

  Vector hessian_times(const Vector& d) const {
    Vector y;
    newton_.multiply(d, y);
    clear_multipliers(y);
    add(-damping_, d, y);
    return y;
  }
  Vector constraint_image(const Vector& d) const {  // A d, in the multiplier rows
    Vector y;
    projection_.multiply(d, y);
    clear_tangents(y);
    return y;
  }
  Vector constraint_transposed(const Vector& c) const {  // A^T c
    Vector y;
    projection_.multiply(c, y);
    clear_multipliers(y);
    return y;
  }

  Vector interleave(const Vector& tangents, const Vector& multipliers) const {
    Vector x(newton_.rows(), 0.0);
    const int p = newton_.primal(), m = newton_.dual();
    for (int i = 0; i < newton_.nodes(); ++i) {
      double* at = x.data() + newton_.offset(i);
      if (!multipliers.empty()) std::copy_n(multipliers.data() + static_cast<long>(i) * m, m, at);
      if (!tangents.empty()) std::copy_n(tangents.data() + static_cast<long>(i) * p, p, at + m);
    }
    return x;
  }
  Vector tangent(const Vector& x) const {
    const int p = newton_.primal(), m = newton_.dual();
    Vector out(static_cast<std::size_t>(newton_.nodes()) * p);
    for (int i = 0; i < newton_.nodes(); ++i)
      std::copy_n(x.data() + newton_.offset(i) + m, p, out.data() + static_cast<long>(i) * p);
    return out;
  }
  void clear_multipliers(Vector& x) const {
    for (int i = 0; i < newton_.nodes(); ++i)
      std::fill_n(x.data() + newton_.offset(i), newton_.dual(), 0.0);
  }
  void clear_tangents(Vector& x) const {
    for (int i = 0; i < newton_.nodes(); ++i)
      std::fill_n(x.data() + newton_.offset(i) + newton_.dual(), newton_.primal(), 0.0);
  }

  // ---- outcome
  // -----------------------------------------------------------------------------------

  bool report(int iteration) {
    record_.iteration = iteration;
    record_.objective = current_.objective;
    record_.terms = current_.terms;
    record_.constraint_norm = current_.constraint_norm;
    record_.frame_violation = current_.frame_violation;
    record_.elapsed = watch_.total();
    record_.ordering = newton_.ordering();
    return !observer_ || observer_(record_, state_);
  }

  // Line 19 looks at the last step whether or not it was taken.
  bool converged() const {
    return step_norm_inf_ < options_.step_tolerance &&
           current_.constraint_norm < options_.constraint_tolerance;
  }

  Result solved(int iterations) const {
    return {Status::solved,
            format("last step %.2e < %.1e (%s) and |C| = %.2e < %.1e; objective %.6g",
                   step_norm_inf_, options_.step_tolerance,
                   record_.accepted ? "taken" : "refused, cut by the trust region",
                   current_.constraint_norm, options_.constraint_tolerance, current_.objective),
            iterations};
  }

  Result stalled(int iterations) const {
    if (accepted_ == 0 && first_violation_ >= options_.constraint_limit) {
      return {Status::stalled,
              format("no step was ever taken: the initial guess has |C| = %.2e, above C_max = %.2e",
                     first_violation_, options_.constraint_limit),
              iterations};
    }
    return {Status::stalled,
            format("the trust region shrank to %.1e after %d accepted steps; objective %.6g, |C| = "
                   "%.2e (tolerance %.1e), penalty %.1e",
                   radius_, accepted_, current_.objective, current_.constraint_norm,
                   options_.constraint_tolerance, penalty_),
            iterations};
  }

  Result failure(int iteration) const {
    return {
        Status::numerical_failure,
        format("the KKT matrix could not be factored at damping %.1e: ", damping_) + factor_error_,
        iteration};
  }

  Result interrupted(int iterations) const {
    return {Status::interrupted,
            format("stopped on request after %d iterations; objective %.6g, |C| = %.2e", iterations,
                   current_.objective, current_.constraint_norm),
            iterations};
  }

  TrajectoryProblem& problem_;
  const PaperOptions options_;
  State& state_;
  const Observer& observer_;
  KktSystem newton_, projection_;  // [H A^T; A 0] and [I A^T; A 0]
  Stopwatch watch_;
  double penalty_, radius_ = HUGE_VAL, damping_ = 0;
  double step_norm_inf_ = 0, first_violation_ = 0;
  int accepted_ = 0;
  bool factored_ = false, projected_ = false;
  Evaluation current_, trial_;
  State trial_state_;
  Linearization lin_;
  Vector gradient_, constraint_;  // b in the tangent rows, C0 in the multiplier rows
  Vector newton_step_, shortest_step_;
  IterationRecord record_;
  PhaseSeconds pending_;
  std::string factor_error_ = "no finite step";
};

}  // namespace

Result solve_paper(TrajectoryProblem& problem, const PaperOptions& options, State& state,
                   const Observer& observer) {
  return PaperSolver(problem, options, state, observer).run();
}

}  // namespace trajopt
