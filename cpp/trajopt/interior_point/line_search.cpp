// Filter line search with second-order corrections [2.3, 2.4].
#include <algorithm>
#include <cfloat>
#include <cmath>

#include "trajopt/interior_point/method.h"

namespace trajopt::interior_point {

namespace {

constexpr double kGammaTheta = 1e-5, kGammaPhi = 1e-8;      // (18)
constexpr double kDelta = 1.0, kSTheta = 1.1, kSPhi = 2.3;  // (19)
constexpr double kArmijo = 1e-8;                            // eta_phi (20)
constexpr double kGammaAlpha = 0.05;                        // (23)
constexpr double kSecondOrder = 0.99;                       // kappa_soc
constexpr int kSecondOrderSteps = 4;                        // p_max
constexpr double kTinyStep = 10.0 * DBL_EPSILON;
constexpr double kLeastDistance = DBL_EPSILON;  // relative, of y from its bounds

// Compares up to rounding errors in the size of `reference`.
bool not_above(double a, double b, double reference) {
  return a - b <= 10.0 * DBL_EPSILON * std::abs(reference);
}

}  // namespace

void Method::move(const double* dy, double alpha, double* y) const {
  for (int i = 0; i < n_ + m_; ++i) {
    y[i] = it_.y[i] + alpha * dy[i];
    // Rounding must not put a point on its bound.
    if (bounds_.below(i)) {
      const double least = kLeastDistance * std::max(1.0, std::abs(bounds_.lower[i]));
      y[i] = std::max(y[i], bounds_.lower[i] + least);
    }
    if (bounds_.above(i)) {
      const double least = kLeastDistance * std::max(1.0, std::abs(bounds_.upper[i]));
      y[i] = std::min(y[i], bounds_.upper[i] - least);
    }
  }
}

double Method::directional_derivative() const {
  double sum = 0.0;
  for (int i = 0; i < n_; ++i) sum += problem_.gradient()[i] * step_.dy[i];
  for (int i = 0; i < n_ + m_; ++i) {
    if (!bounds_.fixed(i)) sum += barrier_gradient(bounds_, it_.y.data(), mu_, i) * step_.dy[i];
  }
  return sum;
}

bool Method::acceptable(const Values& trial, double alpha, double slope, bool& augment) const {
  if (!filter_.accepts(trial.theta, trial.phi)) return false;
  const bool switching =
      slope < 0.0 && alpha * std::pow(-slope, kSPhi) > kDelta * std::pow(now_.theta, kSTheta);
  if (switching && now_.theta <= theta_least_) {
    augment = false;
    return not_above(trial.phi, now_.phi + kArmijo * alpha * slope, now_.phi);
  }
  augment = !(switching && not_above(trial.phi, now_.phi + kArmijo * alpha * slope, now_.phi));
  return not_above(trial.theta, (1.0 - kGammaTheta) * now_.theta, now_.theta) ||
         not_above(trial.phi, now_.phi - kGammaPhi * now_.theta, now_.phi);
}

// Of a step taken, for the record.
void Method::take_note(const Direction& d, double alpha, double dual) {
  record_.step_norm = 0.0;
  for (int i = 0; i < n_; ++i) {
    record_.step_norm = std::max(record_.step_norm, std::abs(alpha * d.dy[i]));
  }
  record_.primal_step = alpha;
  record_.dual_step = dual;
}

void Method::accept(const Direction& d, double alpha, bool augment) {
  if (augment) {
    filter_.add((1.0 - kGammaTheta) * now_.theta, now_.phi - kGammaPhi * now_.theta);
  }
  const double dual = dual_step_limit(bounds_, it_, d.dzl.data(), d.dzu.data(), tau_);
  take_note(d, alpha, dual);
  std::swap(it_.y, saved_y_);
  for (int i = 0; i < m_; ++i) it_.lambda[i] += alpha * d.dlambda[i];
  for (int i = 0; i < n_ + m_; ++i) {
    it_.zl[i] += dual * d.dzl[i];
    it_.zu[i] += dual * d.dzu[i];
  }
  std::swap(now_, trial_);
  safeguard_bound_multipliers(bounds_, it_, mu_);
}

// Steps from the same matrix that aim at the rows' values at the trial point (27); at entry trial_
// is that of the full step, which made theta worse.
bool Method::correct_second_order(double alpha, double slope, bool& augment) {
  double before = 0.0, alpha_soc = alpha;
  std::copy_n(now_.residual.data(), m_, soc_.data());
  for (int p = 0; p < kSecondOrderSteps; ++p) {
    if (p > 0 && trial_.theta > kSecondOrder * before) return false;
    before = trial_.theta;
    for (int i = 0; i < m_; ++i) soc_[i] = alpha_soc * soc_[i] + trial_.residual[i];
    Stopwatch watch;
    right_hand_side(soc_.data());
    kkt_.solve(b1_.data(), b2_.data(), e_.data(), corrected_.dy.data(), corrected_.dlambda.data());
    complete_direction(corrected_);
    spent_.solve += watch.lap();
    alpha_soc = primal_step_limit(bounds_, it_.y.data(), corrected_.dy.data(), tau_);
    move(corrected_.dy.data(), alpha_soc, saved_y_.data());
    ++record_.trials;
    if (!evaluate(saved_y_.data(), trial_)) return false;
    if (acceptable(trial_, alpha, slope, augment)) {
      record_.corrected = true;
      accept(corrected_, alpha_soc, augment);
      return true;
    }
  }
  return false;
}

Method::Search Method::search() {
  record_.trials = 0;
  record_.corrected = false;
  const double largest = primal_step_limit(bounds_, it_.y.data(), step_.dy.data(), tau_);
  const double slope = directional_derivative();
  double relative = 0.0;
  for (int i = 0; i < n_ + m_; ++i) {
    relative = std::max(relative, std::abs(step_.dy[i]) / (1.0 + std::abs(it_.y[i])));
  }
  if (relative < kTinyStep) {
    // Nothing left to gain at this mu: take the step unseen, and the next mu.
    if (tiny_) return Search::failed;
    move(step_.dy.data(), largest, saved_y_.data());
    if (!evaluate(saved_y_.data(), trial_)) return Search::failed;
    accept(step_, largest, false);
    tiny_ = true;
    return Search::accepted;
  }
  tiny_ = false;
  double least = kGammaTheta;
  if (slope < 0.0) {
    least = std::min(least, kGammaPhi * now_.theta / -slope);
    if (now_.theta <= theta_least_) {
      least = std::min(least, kDelta * std::pow(now_.theta, kSTheta) / std::pow(-slope, kSPhi));
    }
  }
  least *= kGammaAlpha;
  bool augment = false;
  for (double alpha = largest; alpha >= least && alpha > DBL_MIN; alpha *= 0.5) {
    move(step_.dy.data(), alpha, saved_y_.data());
    ++record_.trials;
    if (!evaluate(saved_y_.data(), trial_)) continue;
    if (acceptable(trial_, alpha, slope, augment)) {
      accept(step_, alpha, augment);
      return Search::accepted;
    }
    if (alpha == largest && trial_.theta >= now_.theta &&
        correct_second_order(alpha, slope, augment)) {
      return Search::accepted;
    }
  }
  return Search::restore;
}

}  // namespace trajopt::interior_point
