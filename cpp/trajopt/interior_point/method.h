// The state of one interior point solve, shared by its parts: the loop (interior_point.cpp), its
// start (start.cpp), steps (direction.cpp), line search (line_search.cpp) and restoration phase
// (restoration.cpp).
#pragma once

#include <string>

#include "trajopt/interior_point/barrier.h"
#include "trajopt/interior_point/filter.h"
#include "trajopt/interior_point/interior_point.h"
#include "trajopt/interior_point/kkt.h"
#include "trajopt/solver/stopwatch.h"

namespace trajopt::interior_point {

// Regularization of the rows, refined away again (see kkt.h).
inline constexpr double kRowEpsilon = 1e-10;

class Method {
 public:
  Method(StagedProblem& problem, const Options& options, const Observer& observer);
  Outcome run(Point& point);

 private:
  // What is known at a point y: objective f, rows c(x), residual c(x) - s and the two measures of
  // the filter, theta = |c - s|_1 and phi = f - mu sum of logarithms.
  struct Values {
    double objective = 0, theta = 0, phi = 0;
    std::vector<double> c, residual;
  };
  struct Direction {
    std::vector<double> dy, dlambda, dzl, dzu;
  };
  struct Errors {
    double dual = 0, primal = 0, complementarity = 0, total = 0;
  };
  enum class Search { accepted, restore, failed };

  // start.cpp
  void start(const Point& point);
  void estimate_multipliers();

  // interior_point.cpp
  bool evaluate(const double* y, Values& v);
  bool differentiate();
  void gradient_of_lagrangian();
  Errors errors(double mu) const;
  bool reduce_barrier();
  double user_violation() const;
  bool report(const Errors& e);
  Outcome finish(Status status, const std::string& message, Point& point);

  // direction.cpp
  bool find_direction();
  double row_compliance(int row, double delta) const;
  void right_hand_side(const double* residual);
  void complete_direction(Direction& d);

  // line_search.cpp
  Search search();
  double directional_derivative() const;
  void move(const double* dy, double alpha, double* y) const;
  bool acceptable(const Values& trial, double alpha, double slope, bool& augment) const;
  bool correct_second_order(double alpha, double slope, bool& augment);
  void accept(const Direction& d, double alpha, bool augment);

  // restoration.cpp
  enum class Restored { yes, infeasible, no };
  Restored restore();
  bool restoration_step(double mu, double damping);

  StagedProblem& user_;
  Options options_;
  const Observer& observer_;
  ScaledProblem problem_;
  int n_, m_;  // variables, rows
  Bounds bounds_;
  Kkt kkt_;
  Filter filter_;

  Iterate it_;
  Values now_, trial_;
  Direction step_, corrected_;
  std::vector<double> gradient_;  // of the Lagrangian without bounds, over y
  std::vector<double> diagonal_, e_, regularized_, b1_, b2_, soc_, saved_y_;
  Iterate saved_;
  double mu_, tau_, theta_least_ = 0, theta_most_ = 0;
  double delta_ = 0, delta_last_ = 0;
  bool tiny_ = false;
  Record record_;
  std::vector<Record> history_;
  Stopwatch clock_;
  Seconds spent_;
};

}  // namespace trajopt::interior_point
