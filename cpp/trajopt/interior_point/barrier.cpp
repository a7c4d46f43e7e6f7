#include "trajopt/interior_point/barrier.h"

#include <algorithm>
#include <cmath>

namespace trajopt::interior_point {

namespace {

constexpr double kSigma = 1e10;
constexpr double kDamping = 1e-5;  // kappa_d

}  // namespace

Bounds::Bounds(std::vector<double> lo, std::vector<double> up)
    : lower(std::move(lo)), upper(std::move(up)), kind_(lower.size()) {
  for (int i = 0; i < size(); ++i) {
    if (lower[i] == upper[i]) {
      kind_[i] = kFixed;
    } else {
      kind_[i] = static_cast<unsigned char>((std::isfinite(lower[i]) ? kLower : kFree) |
                                            (std::isfinite(upper[i]) ? kUpper : kFree));
      count_ += std::isfinite(lower[i]) + std::isfinite(upper[i]);
    }
  }
}

void Bounds::push_inside(double* y, double push) const {
  for (int i = 0; i < size(); ++i) {
    const double gap = upper[i] - lower[i];
    const double l = std::min(push * std::max(1.0, std::abs(lower[i])), push * gap);
    const double u = std::min(push * std::max(1.0, std::abs(upper[i])), push * gap);
    switch (kind_[i]) {
      case kFixed:
        y[i] = lower[i];
        break;
      case kBoth:
        y[i] = std::min(std::max(y[i], lower[i] + l), upper[i] - u);
        break;
      case kLower:
        y[i] = std::max(y[i], lower[i] + l);
        break;
      case kUpper:
        y[i] = std::min(y[i], upper[i] - u);
        break;
      default:
        break;
    }
  }
}

double Bounds::log_barrier(const double* y) const {
  // Several distances share one logarithm; a product of eight stays far from over- and underflow.
  double sum = 0.0, product = 1.0, distances = 0.0;
  int factors = 0;
  const auto take = [&](double distance) {
    if (!(distance > 1e-30 && distance < 1e30)) {
      sum -= std::log(distance);
      return;
    }
    product *= distance;
    if (++factors == 8) {
      sum -= std::log(product);
      product = 1.0;
      factors = 0;
    }
  };
  for (int i = 0; i < size(); ++i) {
    if (below(i)) take(y[i] - lower[i]);
    if (above(i)) take(upper[i] - y[i]);
    if (kind_[i] == kLower) distances += y[i] - lower[i];
    if (kind_[i] == kUpper) distances += upper[i] - y[i];
  }
  return sum - std::log(product) + kDamping * distances;
}

double barrier_gradient(const Bounds& b, const double* y, double mu, int i) {
  double g = 0.0;
  if (b.below(i)) g -= mu / (y[i] - b.lower[i]);
  if (b.above(i)) g += mu / (b.upper[i] - y[i]);
  if (b.below(i) != b.above(i)) g += b.below(i) ? mu * kDamping : -mu * kDamping;
  return g;
}

double barrier_curvature(const Bounds& b, const Iterate& it, int i) {
  double sigma = 0.0;
  if (b.below(i)) sigma += it.zl[i] / (it.y[i] - b.lower[i]);
  if (b.above(i)) sigma += it.zu[i] / (b.upper[i] - it.y[i]);
  return sigma;
}

void bound_multiplier_steps(const Bounds& b, const Iterate& it, const double* dy, double mu,
                            double* dzl, double* dzu) {
  for (int i = 0; i < b.size(); ++i) {
    dzl[i] = dzu[i] = 0.0;
    if (b.below(i)) {
      const double d = it.y[i] - b.lower[i];
      dzl[i] = (mu - it.zl[i] * dy[i]) / d - it.zl[i];
    }
    if (b.above(i)) {
      const double d = b.upper[i] - it.y[i];
      dzu[i] = (mu + it.zu[i] * dy[i]) / d - it.zu[i];
    }
  }
}

double primal_step_limit(const Bounds& b, const double* y, const double* dy, double tau) {
  double alpha = 1.0;
  for (int i = 0; i < b.size(); ++i) {
    if (dy[i] < 0.0 && b.below(i)) alpha = std::min(alpha, -tau * (y[i] - b.lower[i]) / dy[i]);
    if (dy[i] > 0.0 && b.above(i)) alpha = std::min(alpha, tau * (b.upper[i] - y[i]) / dy[i]);
  }
  return alpha;
}

double dual_step_limit(const Bounds& b, const Iterate& it, const double* dzl, const double* dzu,
                       double tau) {
  double alpha = 1.0;
  for (int i = 0; i < b.size(); ++i) {
    if (dzl[i] < 0.0) alpha = std::min(alpha, -tau * it.zl[i] / dzl[i]);
    if (dzu[i] < 0.0) alpha = std::min(alpha, -tau * it.zu[i] / dzu[i]);
  }
  return alpha;
}

void safeguard_bound_multipliers(const Bounds& b, Iterate& it, double mu) {
  const auto keep = [mu](double& z, double distance) {
    z = std::max(std::min(z, kSigma * mu / distance), mu / (kSigma * distance));
  };
  for (int i = 0; i < b.size(); ++i) {
    if (b.below(i)) keep(it.zl[i], it.y[i] - b.lower[i]);
    if (b.above(i)) keep(it.zu[i], b.upper[i] - it.y[i]);
  }
}

double complementarity(const Bounds& b, const Iterate& it, double mu) {
  double most = 0.0;
  for (int i = 0; i < b.size(); ++i) {
    if (b.below(i)) most = std::max(most, std::abs((it.y[i] - b.lower[i]) * it.zl[i] - mu));
    if (b.above(i)) most = std::max(most, std::abs((b.upper[i] - it.y[i]) * it.zu[i] - mu));
  }
  return most;
}

}  // namespace trajopt::interior_point
