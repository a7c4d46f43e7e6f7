#include "trajopt/interior_point/interior_point.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

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
      tau_(std::max(kLeastTau, 1.0 - mu_)),
      free_(options.barrier_rule == BarrierRule::adaptive && bounds_.count() > 0) {
  for (Iterate* it : {&it_, &saved_}) {
    for (auto* v : {&it->y, &it->zl, &it->zu}) v->resize(n_ + m_);
    it->lambda.resize(m_);
  }
  for (Values* v : {&now_, &trial_}) {
    v->c.resize(m_);
    v->residual.resize(m_);
  }
  errors_.fill(std::numeric_limits<double>::infinity());
  for (Direction* d : {&step_, &corrected_, &affine_, &centering_}) {
    if ((d == &affine_ || d == &centering_) && !free_) continue;
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

double Method::least_barrier() const { return options_.tolerance / (kBarrierError + 1.0); }

// Lowers mu while the barrier problem is solved well enough for it; then the filter starts anew.
void Method::reduce_barrier() {
  const double least = least_barrier();
  double mu = mu_;
  while (mu > least && (tiny_ || errors(mu).total <= kBarrierError * mu)) {
    mu = std::max(least, std::min(kBarrierFactor * mu, std::pow(mu, kBarrierPower)));
    tiny_ = false;
  }
  if (mu < mu_) set_barrier(mu, std::max(kLeastTau, 1.0 - mu));
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

// An end with the numbers that caused it.
Outcome Method::stop(Status status, Point& point) {
  char text[240] = "";
  const double error = record_.error, violation = user_violation();
  switch (status) {
    case Status::solved:
      std::snprintf(text, sizeof text, "optimality error %.2e <= %.2e after %d iterations", error,
                    options_.tolerance, record_.iteration);
      break;
    case Status::max_iterations:
      std::snprintf(text, sizeof text,
                    "optimality error %.2e > %.2e, constraint violation %.2e after %d iterations",
                    error, options_.tolerance, violation, record_.iteration);
      break;
    case Status::interrupted:
      std::snprintf(text, sizeof text, "stopped by the observer at iteration %d",
                    record_.iteration);
      break;
    case Status::infeasible:
      std::snprintf(text, sizeof text,
                    "the constraints cannot all be met: their violation, %.3e at most, has a "
                    "local minimum here",
                    violation);
      break;
    case Status::stalled:
      std::snprintf(text, sizeof text,
                    "no acceptable step left: optimality error %.2e > %.2e, constraint violation "
                    "%.2e",
                    error, options_.tolerance, violation);
      break;
    default:
      std::snprintf(text, sizeof text, "derivatives are not finite at iteration %d",
                    record_.iteration);
  }
  return finish(status, text, point);
}

// Derivatives at a point whose multipliers are not known yet.
bool Method::differentiate_anew() {
  if (!differentiate()) return false;
  estimate_multipliers();
  return differentiate();
}

Outcome Method::run(Point& point) {
  start(point);
  const bool known = options_.warm_start && !point.multipliers.empty();
  if (!std::isfinite(now_.objective) || !(known ? differentiate() : differentiate_anew())) {
    return finish(Status::numerical_failure,
                  "objective, constraints or derivatives are not finite at the start", point);
  }
  if (!evaluate(it_.y.data(), now_)) {
    return finish(Status::numerical_failure, "the constraints are not finite at the start", point);
  }
  theta_most_ = 1e4 * std::max(1.0, now_.theta);
  theta_least_ = 1e-4 * std::max(1.0, now_.theta);
  filter_.reset(theta_most_);
  const bool adaptive = free_;
  for (;; ++record_.iteration) {
    gradient_of_lagrangian();
    const Errors e = errors(0.0);
    if (!report(e)) return stop(Status::interrupted, point);
    if (e.total <= options_.tolerance && user_violation() <= kUserViolation) {
      return stop(Status::solved, point);
    }
    if (record_.iteration >= options_.max_iterations) return stop(Status::max_iterations, point);
    if (adaptive) choose_mode(e.total);
    if (!free_) reduce_barrier();
    record_.restoration = false;
    Search result = find_direction() ? search() : Search::restore;
    if (result != Search::accepted && free_) {
      enter_monotone_mode();
      result = find_direction() ? search() : Search::restore;
    }
    record_.regularization = delta_;
    if (result == Search::failed) return stop(Status::stalled, point);
    if (result == Search::restore) {
      const Status restored = restore();
      if (restored != Status::solved) return stop(restored, point);
      record_.restoration = true;
    }
    if (!(record_.restoration ? differentiate_anew() : differentiate())) {
      return stop(Status::numerical_failure, point);
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
