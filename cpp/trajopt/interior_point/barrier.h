// Unknowns y = (x, s) of the barrier problem, variables and slacks of all constraint rows, with
// their bounds, and what the method computes from them element by element. A pinned variable and
// the "slack" of an equality are fixed: they have a value and no barrier.
#pragma once

#include <vector>

namespace trajopt::interior_point {

class Bounds {
 public:
  Bounds(std::vector<double> lower, std::vector<double> upper);

  int size() const { return static_cast<int>(lower.size()); }
  bool fixed(int i) const { return kind_[i] == kFixed; }
  bool free(int i) const { return kind_[i] == kFree; }
  bool below(int i) const { return (kind_[i] & kLower) != 0; }  // is there a lower bound?
  bool above(int i) const { return (kind_[i] & kUpper) != 0; }
  int count() const { return count_; }  // of bounds with a barrier

  // Moves y inside: at least push away from a bound, or that share of the gap between two [3.6].
  void push_inside(double* y, double push) const;

  // -sum of log(distance to bound), for the barrier term, and a slope that keeps what has one bound
  // only from running away from it: + kappa_d times the distance [3.7].
  double log_barrier(const double* y) const;

  std::vector<double> lower, upper;

 private:
  enum Kind : unsigned char { kFree = 0, kLower = 1, kUpper = 2, kBoth = 3, kFixed = 4 };
  std::vector<unsigned char> kind_;
  int count_ = 0;
};

struct Iterate {
  std::vector<double> y, zl, zu;  // y = (x, s), multipliers of its bounds
  std::vector<double> lambda;     // of the rows c(x) - s = 0
};

// d/dy of mu times log_barrier.
double barrier_gradient(const Bounds& b, const double* y, double mu, int i);

// Sigma = zl / (y - lower) + zu / (upper - y) (13).
double barrier_curvature(const Bounds& b, const Iterate& it, int i);

// Steps of the bound multipliers that belong to dy (12).
void bound_multiplier_steps(const Bounds& b, const Iterate& it, const double* dy, double mu,
                            double* dzl, double* dzu);

// Largest alpha in (0, 1] with y + alpha dy at least (1 - tau) as far from its bounds as y (15).
double primal_step_limit(const Bounds& b, const double* y, const double* dy, double tau);
double dual_step_limit(const Bounds& b, const Iterate& it, const double* dzl, const double* dzu,
                       double tau);

// Keeps the primal-dual curvature within a factor kappa_Sigma of mu / distance^2 (16).
void safeguard_bound_multipliers(const Bounds& b, Iterate& it, double mu);

// max |(distance) z - mu| over all bounds.
double complementarity(const Bounds& b, const Iterate& it, double mu);

}  // namespace trajopt::interior_point
