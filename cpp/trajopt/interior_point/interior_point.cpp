#include "trajopt/interior_point/interior_point.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "trajopt/base/error.h"
#include "trajopt/interior_point/method.h"

namespace trajopt::interior_point {

namespace {

constexpr double kErrorScale = 100.0;    // s_max (5)
constexpr double kBarrierError = 10.0;   // kappa_epsilon (7)
constexpr double kBarrierFactor = 0.2;   // kappa_mu (7)
constexpr double kBarrierPower = 1.5;    // theta_mu (7)
constexpr double kLeastTau = 0.99;       // tau_min (8)
constexpr int kReserved = 10000;         // iterations whose records need no allocation
constexpr double kUserViolation = 1e-4;  // in the user's units, whatever the scales

std::vector<double> joined(const std::vector<double>& a, const std::vector<double>& b) {
  std::vector<double> all(a);
  all.insert(all.end(), b.begin(), b.end());
  return all;
}

}  // namespace

Method::Method(StagedProblem& problem, const Options& options, const Observer& observer)
    : user_(problem),
      options_(options),
      observer_(observer),
      problem_(problem),
      n_(problem.variables()),
      m_(problem.rows()),
      bounds_(joined(problem.lower, problem.constraint_lower),
              joined(problem.upper, problem.constraint_upper)),
      kkt_(problem_, options.ordering, options.threads, options.refinements),
      filter_(std::min(options.max_iterations, kReserved) + 1),
      gradient_(n_ + m_),
      diagonal_(n_),
      e_(m_),
      regularized_(m_),
      b1_(n_),
      b2_(m_),
      soc_(m_),
      saved_y_(n_ + m_),
      mu_(options.barrier),
      tau_(std::max(kLeastTau, 1.0 - mu_)) {
  for (Iterate* it : {&it_, &saved_}) {
    for (auto* v : {&it->y, &it->zl, &it->zu}) v->resize(n_ + m_);
    it->lambda.resize(m_);
  }
  for (Values* v : {&now_, &trial_}) {
    v->c.resize(m_);
    v->residual.resize(m_);
  }
  for (Direction* d : {&step_, &corrected_}) {
    for (auto* v : {&d->dy, &d->dzl, &d->dzu}) v->resize(n_ + m_);
    d->dlambda.resize(m_);
  }
  history_.reserve(std::min(options.max_iterations, kReserved) + 1);
}

// Theta, phi and the residual at y; false when something is not finite.
bool Method::evaluate(const double* y, Values& v) {
  Stopwatch watch;
  const bool good = problem_.values(y, v.objective, v.c.data());
  spent_.evaluation += watch.lap();
  if (!good) return false;
  v.theta = 0.0;
  for (int i = 0; i < m_; ++i) {
    v.residual[i] = bounds_.free(n_ + i) ? 0.0 : v.c[i] - y[n_ + i];
    v.theta += std::abs(v.residual[i]);
  }
  v.phi = v.objective + mu_ * bounds_.log_barrier(y);
  return std::isfinite(v.theta) && std::isfinite(v.phi);
}

bool Method::differentiate() {
  Stopwatch watch;
  const bool good = problem_.derivatives(it_.y.data(), it_.lambda.data());
  spent_.evaluation += watch.lap();
  return good;
}

void Method::gradient_of_lagrangian() {
  std::copy_n(problem_.gradient().data(), n_, gradient_.data());
  problem_.add_jacobian_transposed_product(it_.lambda.data(), gradient_.data());
  for (int i = 0; i < m_; ++i) gradient_[n_ + i] = -it_.lambda[i];
  for (int i = 0; i < n_ + m_; ++i) {
    if (bounds_.fixed(i)) gradient_[i] = 0.0;
  }
}

// Scaled optimality error E_mu (5).
Method::Errors Method::errors(double mu) const {
  Errors e;
  double multipliers = 0.0, bound_multipliers = 0.0;
  for (int i = 0; i < n_ + m_; ++i) {
    if (bounds_.fixed(i)) continue;
    e.dual = std::max(e.dual, std::abs(gradient_[i] - it_.zl[i] + it_.zu[i]));
    bound_multipliers += it_.zl[i] + it_.zu[i];
  }
  for (int i = 0; i < m_; ++i) {
    e.primal = std::max(e.primal, std::abs(now_.residual[i]));
    multipliers += std::abs(it_.lambda[i]);
  }
  const int bounds = bounds_.count();
  const double sd =
      std::max(kErrorScale, (multipliers + bound_multipliers) / std::max(1, m_ + bounds));
  const double sc = std::max(kErrorScale, bound_multipliers / std::max(1, bounds));
  e.dual *= kErrorScale / sd;
  e.complementarity = complementarity(bounds_, it_, mu) * kErrorScale / sc;
  e.total = std::max({e.dual, e.primal, e.complementarity});
  return e;
}

double Method::user_violation() const {
  double most = 0.0;
  for (int i = 0; i < m_; ++i) {
    const double c = now_.c[i];
    const double v = std::max({0.0, bounds_.lower[n_ + i] - c, c - bounds_.upper[n_ + i]});
    most = std::max(most, v / problem_.row_scale()[i]);
  }
  return most;
}

// Lowers mu while the barrier problem is solved well enough for it; true: the filter starts anew.
bool Method::reduce_barrier() {
  const double least = options_.tolerance / (kBarrierError + 1.0);
  bool changed = false;
  while (mu_ > least && (tiny_ || errors(mu_).total <= kBarrierError * mu_)) {
    mu_ = std::max(least, std::min(kBarrierFactor * mu_, std::pow(mu_, kBarrierPower)));
    tau_ = std::max(kLeastTau, 1.0 - mu_);
    tiny_ = false;
    changed = true;
  }
  return changed;
}

bool Method::report(const Errors& e) {
  spent_.assembly = kkt_.assembly_seconds;
  spent_.factorization = kkt_.factorization_seconds;
  record_.objective = now_.objective / problem_.objective_scale();
  record_.constraint_norm = user_violation();
  record_.error = e.total;
  record_.dual_norm = e.dual;
  record_.complementarity = e.complementarity;
  record_.barrier = mu_;
  record_.seconds = spent_;
  record_.elapsed = clock_.total();
  history_.push_back(record_);
  spent_ = {};
  kkt_.assembly_seconds = kkt_.factorization_seconds = 0.0;
  return !observer_ || observer_(record_, it_.y.data());
}

Outcome Method::finish(Status status, const std::string& message, Point& point) {
  Outcome out{status,
              message,
              record_.iteration,
              now_.objective / problem_.objective_scale(),
              std::move(history_),
              std::vector<double>(m_)};
  const double f = problem_.objective_scale();
  point.x.assign(it_.y.begin(), it_.y.begin() + n_);
  point.multipliers.resize(m_);
  point.bound_multipliers.resize(n_);
  for (int i = 0; i < m_; ++i) {
    const double scale = problem_.row_scale()[i];
    point.multipliers[i] = it_.lambda[i] * scale / f;
    const double c = now_.c[i];
    out.violation[i] =
        (std::max(0.0, c - bounds_.upper[n_ + i]) - std::max(0.0, bounds_.lower[n_ + i] - c)) /
        scale;
  }
  for (int i = 0; i < n_; ++i) {
    point.bound_multipliers[i] = (it_.zu[i] - it_.zl[i]) / f;
  }
  return out;
}

Outcome Method::run(Point& point) {
  start(point);
  char text[240];
  if (!std::isfinite(now_.objective) || !differentiate()) {
    return finish(Status::numerical_failure,
                  "objective, constraints or derivatives are not finite at the start", point);
  }
  if (!options_.warm_start || point.multipliers.empty()) {
    estimate_multipliers();
    if (!differentiate()) {
      return finish(Status::numerical_failure, "derivatives are not finite at the start", point);
    }
  }
  if (!evaluate(it_.y.data(), now_)) {
    return finish(Status::numerical_failure, "the constraints are not finite at the start", point);
  }
  theta_most_ = 1e4 * std::max(1.0, now_.theta);
  theta_least_ = 1e-4 * std::max(1.0, now_.theta);
  filter_.reset(theta_most_);
  for (;; ++record_.iteration) {
    gradient_of_lagrangian();
    const Errors e = errors(0.0);
    if (!report(e)) {
      std::snprintf(text, sizeof text, "stopped by the observer at iteration %d",
                    record_.iteration);
      return finish(Status::interrupted, text, point);
    }
    if (e.total <= options_.tolerance && user_violation() <= kUserViolation) {
      std::snprintf(text, sizeof text, "optimality error %.2e <= %.2e after %d iterations", e.total,
                    options_.tolerance, record_.iteration);
      return finish(Status::solved, text, point);
    }
    if (record_.iteration >= options_.max_iterations) {
      std::snprintf(text, sizeof text,
                    "optimality error %.2e > %.2e, constraint violation %.2e after %d iterations",
                    e.total, options_.tolerance, user_violation(), record_.iteration);
      return finish(Status::max_iterations, text, point);
    }
    if (reduce_barrier()) {
      filter_.reset(theta_most_);
      now_.phi = now_.objective + mu_ * bounds_.log_barrier(it_.y.data());
    }
    record_.restoration = false;
    const bool found = find_direction();
    record_.regularization = delta_;
    Search result = found ? search() : Search::restore;
    if (result == Search::restore) {
      const Restored restored = restore();
      record_.restoration = true;
      if (restored == Restored::infeasible) {
        std::snprintf(text, sizeof text,
                      "the constraints cannot all be met: their violation, %.3e at most, has a "
                      "local minimum here",
                      user_violation());
        return finish(Status::infeasible, text, point);
      }
      if (restored == Restored::no) result = Search::failed;
    }
    if (result == Search::failed) {
      std::snprintf(text, sizeof text,
                    "no acceptable step left: optimality error %.2e > %.2e, constraint violation "
                    "%.2e",
                    e.total, options_.tolerance, user_violation());
      return finish(Status::stalled, text, point);
    }
    if (!differentiate()) {
      return finish(Status::numerical_failure, "derivatives are not finite", point);
    }
    if (record_.restoration) {
      estimate_multipliers();
      if (!differentiate()) {
        return finish(Status::numerical_failure, "derivatives are not finite", point);
      }
    }
  }
}

Outcome solve(StagedProblem& problem, const Options& options, Point& point,
              const Observer& observer) {
  check(problem);
  if (static_cast<int>(point.x.size()) != problem.variables()) {
    throw ArgumentError("x has length " + std::to_string(point.x.size()) + ", expected " +
                        std::to_string(problem.variables()));
  }
  if (!(options.tolerance > 0.0) || !(options.barrier > 0.0) || options.max_iterations < 0) {
    throw ArgumentError("tolerance = " + std::to_string(options.tolerance) +
                        ", barrier = " + std::to_string(options.barrier) +
                        ", max_iterations = " + std::to_string(options.max_iterations) +
                        ": expected positive, positive and not negative");
  }
  return Method(problem, options, observer).run(point);
}

}  // namespace trajopt::interior_point
