// The adaptive choice of mu: in free mode the one that promises the least optimality error after
// the step, by the quality function; in monotone mode, entered where the error did not fall, the
// rule of Fiacco and McCormick, until it has fallen again. After Nocedal, Waechter and Waltz,
// "Adaptive barrier update strategies for nonlinear interior methods", SIAM J. Optim. 19 (2009).
#include <algorithm>
#include <cmath>

#include "trajopt/interior_point/method.h"

namespace trajopt::interior_point {

namespace {

constexpr double kProgress = 0.9999;  // kappa: the error must fall below this share
constexpr double kRestart = 0.8;      // mu of the monotone mode: share of the mean product
constexpr double kMostBarrier = 1e3;  // mu at most, as a multiple of the first mean product
constexpr double kLeastSigma = 1e-6, kMostSigma = 100.0;
constexpr double kSigmaTolerance = 1e-2;
constexpr int kSectionSteps = 8;
constexpr double kLeastTau = 0.99;

}  // namespace

// Of distance and multiplier over all bounds.
double Method::mean_product() const {
  double sum = 0.0;
  for (int i = 0; i < n_ + m_; ++i) {
    if (bounds_.below(i)) sum += (it_.y[i] - bounds_.lower[i]) * it_.zl[i];
    if (bounds_.above(i)) sum += (bounds_.upper[i] - it_.y[i]) * it_.zu[i];
  }
  return sum / std::max(1, bounds_.count());
}

void Method::set_barrier(double mu, double tau) {
  mu_ = mu;
  tau_ = tau;
  tiny_ = false;
  filter_.reset(theta_most_);
  now_.phi = now_.objective + mu_ * bounds_.log_barrier(it_.y.data());
}

void Method::enter_monotone_mode() {
  free_ = false;
  const double mu = std::clamp(kRestart * mean_product(), least_barrier(), most_barrier_);
  set_barrier(mu, std::max(kLeastTau, 1.0 - mu));
}

// Compares the error with the largest of those of the last free iterations.
void Method::choose_mode(double error) {
  if (most_barrier_ == 0.0) most_barrier_ = kMostBarrier * std::max(mean_product(), mu_);
  const double largest = *std::max_element(errors_.begin(), errors_.end());
  const bool progress = error <= kProgress * largest;
  if (free_ && (!progress || tiny_)) {
    enter_monotone_mode();
  } else if (!free_ && progress) {
    free_ = true;
  }
  if (free_) {
    errors_[next_error_] = error;
    next_error_ = (next_error_ + 1) % static_cast<int>(errors_.size());
  }
}

// step_ = affine_ + mu centering_; what the error would be after it, in the linear model.
double Method::quality(double mu, double tau, double dual, double primal) {
  combine(mu);
  const double alpha = primal_step_limit(bounds_, it_.y.data(), step_.dy.data(), tau);
  const double beta = dual_step_limit(bounds_, it_, step_.dzl.data(), step_.dzu.data(), tau);
  double products = 0.0;
  const auto add = [&](double distance, double change, double z, double dz) {
    const double product = (distance + alpha * change) * (z + beta * dz);
    products += product * product;
  };
  for (int i = 0; i < n_ + m_; ++i) {
    const double dy = step_.dy[i];
    if (bounds_.below(i)) add(it_.y[i] - bounds_.lower[i], dy, it_.zl[i], step_.dzl[i]);
    if (bounds_.above(i)) add(bounds_.upper[i] - it_.y[i], -dy, it_.zu[i], step_.dzu[i]);
  }
  return (1.0 - beta) * (1.0 - beta) * dual + (1.0 - alpha) * (1.0 - alpha) * primal +
         products / std::max(1, bounds_.count());
}

void Method::combine(double mu) {
  const auto sum = [mu](const std::vector<double>& a, const std::vector<double>& b,
                        std::vector<double>& to) {
    for (std::size_t i = 0; i < to.size(); ++i) to[i] = a[i] + mu * b[i];
  };
  sum(affine_.dy, centering_.dy, step_.dy);
  sum(affine_.dlambda, centering_.dlambda, step_.dlambda);
  sum(affine_.dzl, centering_.dzl, step_.dzl);
  sum(affine_.dzu, centering_.dzu, step_.dzu);
}

// The directions for mu = 0 and of mu, from the factors at hand.
bool Method::find_both_directions() {
  mu_ = 0.0;
  right_hand_side(now_.residual.data());
  if (!kkt_.solve(b1_.data(), b2_.data(), e_.data(), affine_.dy.data(), affine_.dlambda.data())) {
    return false;
  }
  complete_direction(affine_);
  const double* y = it_.y.data();
  for (int i = 0; i < n_; ++i) {
    b1_[i] = bounds_.fixed(i) ? 0.0 : -barrier_gradient(bounds_, y, 1.0, i);
  }
  for (int i = 0; i < m_; ++i) {
    const int s = n_ + i;
    b2_[i] = bounds_.fixed(s) ? 0.0 : -e_[i] * barrier_gradient(bounds_, y, 1.0, s);
  }
  Direction& c = centering_;
  if (!kkt_.solve(b1_.data(), b2_.data(), e_.data(), c.dy.data(), c.dlambda.data())) return false;
  for (int i = 0; i < m_; ++i) {
    const int s = n_ + i;
    const bool moves = !bounds_.fixed(s) && !bounds_.free(s);
    c.dy[s] = moves ? e_[i] * (c.dlambda[i] - barrier_gradient(bounds_, y, 1.0, s)) : 0.0;
  }
  for (int i = 0; i < n_ + m_; ++i) {
    c.dzl[i] = c.dzu[i] = 0.0;
    if (bounds_.below(i)) c.dzl[i] = (1.0 - it_.zl[i] * c.dy[i]) / (y[i] - bounds_.lower[i]);
    if (bounds_.above(i)) c.dzu[i] = (1.0 + it_.zu[i] * c.dy[i]) / (bounds_.upper[i] - y[i]);
  }
  return true;
}

// Step and mu of free mode: sigma, mu over the mean product, by golden section.
bool Method::find_free_direction() {
  const double before = mu_;
  if (!find_both_directions()) {
    mu_ = before;
    return false;
  }
  const double mean = mean_product();
  double dual = 0.0, primal = 0.0;
  int unknowns = 0;
  for (int i = 0; i < n_ + m_; ++i) {
    if (bounds_.fixed(i)) continue;
    const double g = gradient_[i] - it_.zl[i] + it_.zu[i];
    dual += g * g;
    ++unknowns;
  }
  for (double r : now_.residual) primal += r * r;
  dual /= std::max(1, unknowns);
  primal /= std::max(1, m_);
  const double tau = std::max(kLeastTau, 1.0 - errors(0.0).total);
  const auto measure = [&](double sigma) { return quality(sigma * mean, tau, dual, primal); };

  double low = std::max(kLeastSigma, least_barrier() / mean);
  double high = std::min(kMostSigma, most_barrier_ / mean);
  double sigma = std::clamp(1.0, std::min(low, high), high);
  if (low < high) {
    const double less = 1.0 - kSigmaTolerance;
    if (low < less && less < high) {
      (measure(less) > measure(1.0) ? low : high) = less;
    }
    const double section = 0.5 * (std::sqrt(5.0) - 1.0);
    double a = high - section * (high - low), b = low + section * (high - low);
    double qa = measure(a), qb = measure(b);
    for (int k = 0; k < kSectionSteps && high - low > kSigmaTolerance * high; ++k) {
      if (qa <= qb) {
        high = b;
        b = a;
        qb = qa;
        a = high - section * (high - low);
        qa = measure(a);
      } else {
        low = a;
        a = b;
        qa = qb;
        b = low + section * (high - low);
        qb = measure(b);
      }
    }
    // An end that was never left may be the best of all.
    sigma = qa <= qb ? a : b;
    double best = std::min(qa, qb);
    for (const double end : {low, high}) {
      const double q = measure(end);
      if (q < best) {
        best = q;
        sigma = end;
      }
    }
  }
  set_barrier(std::clamp(sigma * mean, least_barrier(), most_barrier_), tau);
  combine(mu_);
  return true;
}

}  // namespace trajopt::interior_point
