// The step equations of the interior point method, slacks and bound multipliers eliminated,
//
//   [ K   J^T ] [dx]   [b1]      K = H + diagonal (barrier terms, regularization)
//   [ J   -E  ] [dl] = [b2]      E >= 0 diagonal: 0 for equalities, 1/(barrier term) for slacks
//
// solved through the condensed matrix M = K + J^T (E + epsilon)^-1 J, which has the block
// tridiagonal shape of the stages with blocks of a node's size, and the globals as its border.
//
// Why condensed: the signed factorization without pivoting exists for every order only when K is
// positive definite. At a minimum K is so on the null space of J alone, and then M is positive
// definite for every small enough epsilon, whatever the signs of K. So a Cholesky factorization of
// M that succeeds proves the inertia the method needs, one that fails asks for more
// regularization, and epsilon is taken out again by refinement against the equations above.
//
// Refinement by itself shrinks the residual of a row in steps of epsilon / (epsilon + sigma), sigma
// the eigenvalues of J K^-1 J^T + E: hardly at all where a row is met by weak unknowns only. So the
// corrections are combined as generalized conjugate residuals (Eisenstat, Elman and Schultz 1983):
// each is made orthogonal to those before and gets the length that leaves the least residual.
#pragma once

#include <memory>
#include <vector>

#include "trajopt/interior_point/scaled_problem.h"
#include "trajopt/linalg/bordered.h"

namespace trajopt::interior_point {

class Kkt {
 public:
  Kkt(const ScaledProblem& problem, linalg::Ordering ordering, int threads, int refinements);

  // Assembles and factors M from the problem's current derivatives; H is left out unless
  // `with_hessian`. regularized: E + epsilon, by row, positive. False: M is not positive definite.
  bool factor(const double* diagonal, const double* regularized, bool with_hessian);

  // Solves for the exact E with as many corrections as it takes, at most `refinements`; false: the
  // result is not finite. Entries of pinned variables are ignored and come out as zero.
  bool solve(const double* b1, const double* b2, const double* e, double* dx, double* dl);

  double assembly_seconds = 0.0, factorization_seconds = 0.0;

 private:
  struct Weights {
    double x, rows;  // 1 / what the residual may be
  };

  void assemble(const double* diagonal, bool with_hessian);
  void add_copy(const ScaledProblem::Terms& terms, int k, bool with_hessian);
  void condensed_solve(const double* b1, const double* b2, double* dx, double* dl, double* jdx);
  void product(const double* e, const double* dx, const double* dl, double* y1, double* y2) const;
  bool correct(int step, const double* e, const Weights& w, double* dx, double* dl);

  const ScaledProblem& problem_;
  int variables_, rows_, nodes_, size_, globals_, threads_;
  bool with_hessian_ = true;
  const linalg::BlockKernels& kernels_;
  linalg::SymmetricBlockTridiagonal matrix_;
  std::unique_ptr<linalg::Factorization> plain_;             // without globals
  std::unique_ptr<linalg::BorderedFactorization> bordered_;  // with
  std::vector<double> border_, corner_;                      // M's last columns
  std::vector<double> diagonal_, weight_;                    // weight = 1 / (E + epsilon)
  // Of one copy, dense, rows padded to `ld`: its Hessian, J, -weight J and its share of M.
  struct Local {
    long ld = 0;
    linalg::BlockBuffer hessian, jacobian, weighted, share;
  };
  Local local_[3];
  // A correction z, q = what the matrix makes of it, and 1 / (q, q); (x, rows) in one vector, whose
  // pages nobody touches before they are needed.
  struct Correction {
    std::unique_ptr<double[]> z, q;
    double inverse = 0.0;
  };
  std::vector<Correction> corrections_;
  std::vector<double> residual_, rhs_;
};

}  // namespace trajopt::interior_point
