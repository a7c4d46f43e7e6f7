// The state of one interior point solve, shared by its parts: the loop (interior_point.cpp), its
// start (start.cpp), steps (direction.cpp), line search (line_search.cpp), adaptive barrier
// (adaptive_barrier.cpp) and restoration phase (restoration.cpp).
#pragma once

#include <array>
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
  bool differentiate_anew();
  void gradient_of_lagrangian();
  Errors errors(double mu) const;
  double least_barrier() const;
  void reduce_barrier();
  double user_violation() const;
  bool report(const Errors& e);
  Outcome stop(Status status, Point& point);
  Outcome finish(Status status, const std::string& message, Point& point);

  // direction.cpp
  bool find_direction();
  double row_compliance(int row, double delta) const;
  void right_hand_side(const double* residual);
  void complete_direction(Direction& d);

  // adaptive_barrier.cpp
  double mean_product() const;
  void set_barrier(double mu, double tau);
  void enter_monotone_mode();
  void choose_mode(double error);
  double quality(double mu, double tau, double dual, double primal);
  void combine(double mu);
  bool find_both_directions();
  bool find_free_direction();

  // line_search.cpp
  Search search();
  double directional_derivative() const;
  void move(const double* dy, double alpha, double* y) const;
  bool acceptable(const Values& trial, double alpha, double slope, bool& augment) const;
  bool correct_second_order(double alpha, double slope, bool& augment);
  void take_note(const Direction& d, double alpha, double dual);
  void accept(const Direction& d, double alpha, bool augment);

  // restoration.cpp
  Status restore();  // solved: the filter takes the point
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
  bool free_;                       // in free mode: mu may rise
  Direction affine_, centering_;    // of the adaptive rule
  std::array<double, 5> errors_{};  // of its last free iterations
  int next_error_ = 0;
  double most_barrier_ = 0;
  Record record_;
  std::vector<Record> history_;
  Stopwatch clock_;
  Seconds spent_;
};

}  // namespace trajopt::interior_point
