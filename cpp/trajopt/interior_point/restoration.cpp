// Feasibility restoration: Newton's method on the rows' residual with the bounds as barrier,
//
//   min  1/2 |c(x) - s|^2 - mu sum of logarithms
//
// from where the filter line search gave up, until the filter takes the point and theta has
// fallen. The same condensed matrix serves, with 1 added to E and as H the Hessian of residual.c,
// which is left out (damped Gauss-Newton) where the matrix would not be positive definite.
#include <algorithm>
#include <cmath>

#include "trajopt/interior_point/method.h"

namespace trajopt::interior_point {

namespace {

constexpr double kEnough = 0.9;  // theta must fall below this share [3.3]
constexpr double kArmijo = 1e-4;
constexpr double kStationary = 1e-6;  // gradient of the residual's norm, relative
constexpr double kLeastBarrier = 1e-10;
constexpr double kFirstDamping = 1e-6, kLeastDamping = 1e-12, kMostDamping = 1e12;
constexpr int kMostSteps = 500;
constexpr int kHalvings = 12;

}  // namespace

// The step in step_, for derivatives taken with the residual as multipliers.
bool Method::restoration_step(double mu, double damping) {
  for (int i = 0; i < n_; ++i) {
    diagonal_[i] = barrier_curvature(bounds_, it_, i) + damping;
    b1_[i] = bounds_.fixed(i) ? 0.0 : -barrier_gradient(bounds_, it_.y.data(), mu, i);
  }
  for (int i = 0; i < m_; ++i) {
    const int s = n_ + i;
    const double free = row_compliance(i, damping);
    e_[i] = regularized_[i] = 1.0 + free;
    b2_[i] = -now_.residual[i] - free * barrier_gradient(bounds_, it_.y.data(), mu, s);
  }
  if (!kkt_.factor(diagonal_.data(), regularized_.data(), true) &&
      !kkt_.factor(diagonal_.data(), regularized_.data(), false)) {
    return false;
  }
  const bool solved =
      kkt_.solve(b1_.data(), b2_.data(), e_.data(), step_.dy.data(), step_.dlambda.data());
  if (!solved) return false;
  for (int i = 0; i < m_; ++i) {
    const int s = n_ + i;
    if (bounds_.fixed(s) || bounds_.free(s)) {
      step_.dy[s] = 0.0;
      continue;
    }
    step_.dy[s] =
        (e_[i] - 1.0) * (step_.dlambda[i] - barrier_gradient(bounds_, it_.y.data(), mu, s));
  }
  bound_multiplier_steps(bounds_, it_, step_.dy.data(), mu, step_.dzl.data(), step_.dzu.data());
  return true;
}

Status Method::restore() {
  constexpr double kGammaTheta = 1e-5, kGammaPhi = 1e-8;
  filter_.add((1.0 - kGammaTheta) * now_.theta, now_.phi - kGammaPhi * now_.theta);
  const double theta_start = now_.theta;
  const auto squares = [&](const Values& v) {
    double sum = 0.0;
    for (double r : v.residual) sum += r * r;
    return 0.5 * sum;
  };
  const auto norm = [&](const Values& v) {
    double most = 0.0;
    for (double r : v.residual) most = std::max(most, std::abs(r));
    return most;
  };
  // Rounding errors alone: nothing here to restore.
  if (norm(now_) <= 1e-2 * options_.tolerance) return Status::stalled;
  if (!problem_.derivatives(it_.y.data(), now_.residual.data(), 0.0)) return Status::stalled;
  double mu = std::min(mu_, 0.1 * squares(now_)), damping = kFirstDamping;
  for (int i = 0; i < n_ + m_; ++i) {
    if (bounds_.below(i)) it_.zl[i] = mu / (it_.y[i] - bounds_.lower[i]);
    if (bounds_.above(i)) it_.zu[i] = mu / (bounds_.upper[i] - it_.y[i]);
  }
  bool moved = false;
  for (int k = 0; k < kMostSteps; ++k) {
    // gradient_ = gradient of 1/2 |residual|^2.
    std::fill(gradient_.begin(), gradient_.end(), 0.0);
    problem_.add_jacobian_transposed_product(now_.residual.data(), gradient_.data());
    for (int i = 0; i < m_; ++i) gradient_[n_ + i] = -now_.residual[i];
    double error = 0.0;
    for (int i = 0; i < n_ + m_; ++i) {
      if (bounds_.fixed(i)) continue;
      error = std::max(error, std::abs(gradient_[i] - it_.zl[i] + it_.zu[i]));
    }
    const double size = norm(now_);
    const double gap = complementarity(bounds_, it_, mu);
    if (moved) {
      // A step of this phase is an iteration like others, with this phase's own errors.
      ++record_.iteration;
      record_.restoration = true;
      if (!report({error, size, gap, std::max({error, size, gap})})) return Status::interrupted;
      if (record_.iteration >= options_.max_iterations) return Status::max_iterations;
    }
    moved = false;
    if (std::max(error, gap) <= kStationary * size && mu <= kLeastBarrier * std::max(1.0, size)) {
      return size > 10.0 * options_.tolerance ? Status::infeasible : Status::stalled;
    }
    while (mu > 0.1 * kLeastBarrier && std::max(error, gap) <= 10.0 * mu) {
      mu *= 0.1;
      if (complementarity(bounds_, it_, mu) > 10.0 * mu) break;
    }
    if (!restoration_step(mu, damping)) {
      damping *= 10.0;
      if (damping > kMostDamping) return Status::stalled;
      continue;
    }
    double slope = 0.0;
    for (int i = 0; i < n_ + m_; ++i) {
      if (bounds_.fixed(i)) continue;
      slope += (gradient_[i] + barrier_gradient(bounds_, it_.y.data(), mu, i)) * step_.dy[i];
    }
    const double tau = std::max(0.99, 1.0 - mu);
    double alpha = primal_step_limit(bounds_, it_.y.data(), step_.dy.data(), tau);
    const double merit = squares(now_) + mu * bounds_.log_barrier(it_.y.data());
    record_.trials = 0;
    record_.corrected = false;
    for (int h = 0; h < kHalvings && !moved; ++h, alpha *= 0.5) {
      move(step_.dy.data(), alpha, saved_y_.data());
      ++record_.trials;
      if (!evaluate(saved_y_.data(), trial_)) continue;
      const double next = squares(trial_) + mu * bounds_.log_barrier(saved_y_.data());
      if (next - merit > kArmijo * alpha * slope + 1e-15 * std::abs(merit)) continue;
      const double dual = dual_step_limit(bounds_, it_, step_.dzl.data(), step_.dzu.data(), tau);
      std::swap(it_.y, saved_y_);
      std::swap(now_, trial_);
      for (int i = 0; i < n_ + m_; ++i) {
        it_.zl[i] += dual * step_.dzl[i];
        it_.zu[i] += dual * step_.dzu[i];
      }
      safeguard_bound_multipliers(bounds_, it_, mu);
      damping = h == 0 ? std::max(kLeastDamping, 0.2 * damping) : h > 2 ? 10.0 * damping : damping;
      take_note(step_, alpha, dual);
      record_.regularization = damping;
      moved = true;
    }
    if (!moved) {
      damping *= 10.0;
      if (damping > kMostDamping) return Status::stalled;
      continue;
    }
    if (now_.theta <= kEnough * theta_start && filter_.accepts(now_.theta, now_.phi)) {
      for (int i = 0; i < n_ + m_; ++i) {
        if (bounds_.below(i)) it_.zl[i] = mu_ / (it_.y[i] - bounds_.lower[i]);
        if (bounds_.above(i)) it_.zu[i] = mu_ / (bounds_.upper[i] - it_.y[i]);
      }
      return Status::solved;
    }
    if (!problem_.derivatives(it_.y.data(), now_.residual.data(), 0.0)) return Status::stalled;
  }
  return Status::stalled;
}

}  // namespace trajopt::interior_point
