// The primal-dual step and the inertia correction [2.2, 3.1].
#include <algorithm>
#include <cmath>

#include "trajopt/interior_point/method.h"

namespace trajopt::interior_point {

namespace {

constexpr double kFirstDelta = 1e-4;  // delta_w [3.1]
constexpr double kLeastDelta = 1e-20;
constexpr double kMostDelta = 1e40;
constexpr double kFreeCompliance = 1e20;

}  // namespace

// E of a row: 0 for an equality, 1 / (curvature of its slack) else. A row without bounds is no
// constraint: so compliant that its multiplier stays zero.
double Method::row_compliance(int row, double delta) const {
  const int s = n_ + row;
  if (bounds_.fixed(s)) return 0.0;
  if (bounds_.free(s)) return kFreeCompliance;
  return 1.0 / (barrier_curvature(bounds_, it_, s) + delta);
}

// b1_, b2_ for the rows' residual; e_ and diagonal_ must be those of the factorization.
void Method::right_hand_side(const double* residual) {
  for (int i = 0; i < n_; ++i) {
    b1_[i] =
        bounds_.fixed(i) ? 0.0 : -gradient_[i] - barrier_gradient(bounds_, it_.y.data(), mu_, i);
  }
  for (int i = 0; i < m_; ++i) {
    const int s = n_ + i;
    const double rs =
        bounds_.fixed(s) ? 0.0 : gradient_[s] + barrier_gradient(bounds_, it_.y.data(), mu_, s);
    b2_[i] = -residual[i] - e_[i] * rs;
  }
}

void Method::complete_direction(Direction& d) {
  for (int i = 0; i < m_; ++i) {
    const int s = n_ + i;
    const double g = gradient_[s] + barrier_gradient(bounds_, it_.y.data(), mu_, s);
    const bool moves = !bounds_.fixed(s) && !bounds_.free(s);
    d.dy[s] = moves ? e_[i] * (d.dlambda[i] - g) : 0.0;
  }
  bound_multiplier_steps(bounds_, it_, d.dy.data(), mu_, d.dzl.data(), d.dzu.data());
}

// The primal-dual step, with as much regularization as the inertia asks for [3.1].
bool Method::find_direction() {
  delta_ = 0.0;
  for (;;) {
    for (int i = 0; i < n_; ++i) diagonal_[i] = barrier_curvature(bounds_, it_, i) + delta_;
    for (int i = 0; i < m_; ++i) {
      e_[i] = row_compliance(i, delta_);
      regularized_[i] = e_[i] + kRowEpsilon;
    }
    if (kkt_.factor(diagonal_.data(), regularized_.data(), true)) break;
    if (delta_ == 0.0) {
      delta_ = delta_last_ == 0.0 ? kFirstDelta : std::max(kLeastDelta, delta_last_ / 3.0);
    } else {
      delta_ *= delta_last_ == 0.0 ? 100.0 : 8.0;
    }
    if (delta_ > kMostDelta) return false;
  }
  if (delta_ > 0.0) delta_last_ = delta_;
  Stopwatch watch;
  bool solved;
  if (free_) {
    solved = find_free_direction();
  } else {
    right_hand_side(now_.residual.data());
    solved = kkt_.solve(b1_.data(), b2_.data(), e_.data(), step_.dy.data(), step_.dlambda.data());
    complete_direction(step_);
  }
  spent_.solve += watch.lap();
  return solved;
}

}  // namespace trajopt::interior_point
