// A staged problem as the solver sees it: objective and constraint rows scaled so that no gradient
// at the start is larger than 100 (Waechter and Biegler 2006, 3.8), columns of pinned variables
// zero, and products with its Jacobian J and Hessian H.
#pragma once

#include <array>
#include <vector>

#include "trajopt/interior_point/staged_problem.h"

namespace trajopt::interior_point {

class ScaledProblem {
 public:
  explicit ScaledProblem(StagedProblem& problem);

  // Neighbouring nonzeros of one column.
  struct Run {
    int column, begin, end;
  };

  // One kind of terms with its place in the flat vectors and its scaled derivatives.
  struct Terms {
    const Part* part = nullptr;
    int locals = 0, first_node = 0, first_row = 0;
    std::vector<double> jacobian, hessian;  // count x nonzeros
    std::vector<char> pinned;               // per copy: does it see a pinned variable?
    std::vector<Run> jacobian_runs, hessian_runs;
  };

  int variables() const { return variables_; }
  int rows() const { return rows_; }
  const StagedProblem& problem() const { return problem_; }
  const std::array<Terms, 3>& terms() const { return terms_; }
  bool pinned(int variable) const { return pinned_[variable] != 0; }

  // False when something is not finite. values() leaves x in the problem's buffers.
  bool values(const double* x, double& objective, double* constraint);
  // weight: of the objective in the Hessian.
  bool derivatives(const double* x, const double* multipliers, double weight = 1.0);

  // Takes the scales from the derivatives at a point; a derivatives() call must follow.
  void choose_scales();

  const std::vector<double>& gradient() const { return gradient_; }
  double objective_scale() const { return objective_scale_; }
  const std::vector<double>& row_scale() const { return row_scale_; }

  void add_jacobian_product(const double* v, double* y) const;             // y += J v
  void add_jacobian_transposed_product(const double* v, double* y) const;  // y += J^T v
  void add_hessian_product(const double* v, double* y) const;              // y += H v

 private:
  // The locals of copy k of some terms, out of and into a flat vector. Without globals they are a
  // stretch of it.
  const double* locals(const Terms& terms, int k, const double* flat) const;
  void scatter_add(const Terms& terms, int k, const double* local, double* flat) const;
  template <class Add>
  void add_to_locals(const Terms& terms, int k, double* flat, const Add& add) const;
  void load(const double* x);
  bool take_derivatives(Terms& terms);

  StagedProblem& problem_;
  int variables_, rows_;
  std::array<Terms, 3> terms_;
  std::vector<char> pinned_;
  double objective_scale_ = 1.0;
  std::vector<double> row_scale_, gradient_;
  mutable std::vector<double> local_in_, local_out_;
};

}  // namespace trajopt::interior_point
