// The first iterate, from the user's point, and estimates of the rows' multipliers [3.6].
#include <algorithm>
#include <cmath>

#include "trajopt/interior_point/method.h"

namespace trajopt::interior_point {

namespace {

constexpr double kLargestEstimate = 1e3;  // of multipliers estimated at the start [3.6]

}  // namespace

void Method::start(const Point& point) {
  std::copy_n(point.x.data(), n_, it_.y.data());
  const bool warm = options_.warm_start && static_cast<int>(point.multipliers.size()) == m_;
  const double push = warm ? std::min(1e-9, options_.bound_push) : options_.bound_push;
  for (int i = 0; i < n_; ++i) {
    if (bounds_.fixed(i)) it_.y[i] = bounds_.lower[i];
  }
  std::vector<double> lower(bounds_.lower), upper(bounds_.upper);
  // Bounds of variables first, since the rows are evaluated at the pushed start.
  Bounds variables({lower.begin(), lower.begin() + n_}, {upper.begin(), upper.begin() + n_});
  variables.push_inside(it_.y.data(), push);
  std::fill(it_.lambda.begin(), it_.lambda.end(), 0.0);
  if (options_.scale) {
    if (problem_.derivatives(it_.y.data(), it_.lambda.data())) problem_.choose_scales();
    for (int i = 0; i < m_; ++i) {
      lower[n_ + i] *= problem_.row_scale()[i];
      upper[n_ + i] *= problem_.row_scale()[i];
    }
    bounds_ = Bounds(lower, upper);
  }
  std::fill_n(it_.y.begin() + n_, m_, 0.0);
  evaluate(it_.y.data(), now_);
  std::copy_n(now_.c.data(), m_, it_.y.data() + n_);
  bounds_.push_inside(it_.y.data(), push);
  for (int i = 0; i < n_ + m_; ++i) {
    it_.zl[i] = bounds_.below(i) ? 1.0 : 0.0;
    it_.zu[i] = bounds_.above(i) ? 1.0 : 0.0;
  }
  if (!warm) return;
  const double f = problem_.objective_scale();
  const auto split = [&](int i, double z) {
    const double least = mu_ / 10.0;
    if (bounds_.below(i)) it_.zl[i] = std::max(-z, least);
    if (bounds_.above(i)) it_.zu[i] = std::max(z, least);
  };
  for (int i = 0; i < m_; ++i) {
    it_.lambda[i] = point.multipliers[i] * f / problem_.row_scale()[i];
    split(n_ + i, it_.lambda[i]);
  }
  for (int i = 0; i < n_; ++i) {
    if (!point.bound_multipliers.empty()) split(i, f * point.bound_multipliers[i]);
  }
  safeguard_bound_multipliers(bounds_, it_, mu_);
}

// Least squares: min |grad f + J^T lambda - zl + zu|, over slacks as well [3.6].
void Method::estimate_multipliers() {
  std::fill(diagonal_.begin(), diagonal_.end(), 1.0);
  for (int i = 0; i < n_; ++i) {
    b1_[i] = -(problem_.gradient()[i] - it_.zl[i] + it_.zu[i]);
  }
  for (int i = 0; i < m_; ++i) {
    const int s = n_ + i;
    const bool bounded = !bounds_.fixed(s) && !bounds_.free(s);
    e_[i] = bounded ? 1.0 : row_compliance(i, 0.0);
    b2_[i] = bounded ? it_.zl[s] - it_.zu[s] : 0.0;
    regularized_[i] = e_[i] + kRowEpsilon;
  }
  std::fill(it_.lambda.begin(), it_.lambda.end(), 0.0);
  if (!kkt_.factor(diagonal_.data(), regularized_.data(), false)) return;
  kkt_.solve(b1_.data(), b2_.data(), e_.data(), step_.dy.data(), it_.lambda.data());
  for (double l : it_.lambda) {
    if (!(std::abs(l) <= kLargestEstimate)) {
      std::fill(it_.lambda.begin(), it_.lambda.end(), 0.0);
      return;
    }
  }
}

}  // namespace trajopt::interior_point
