// The KKT matrix of a linearized trajectory problem in symmetric block-tridiagonal storage:
//
//   [H + damping W   A^T]      per node the multipliers come first, then the tangent; two nodes
//   [A               0  ]      make one block, because a frame's physics reaches two frames back.
//
// W = I + smoothing D2^T D2 is the metric steps are measured in (D2: second differences of the
// frames): a trust region in it grants smooth changes of a motion more room than jagged ones.
// A periodic problem closes the ring: its last block is the border of a bordered system.
//
// Ordering::frontal needs no such matrix: it eliminates the nodes of a linearization that was left
// in node_rows.h's form.
#pragma once

#include <memory>
#include <vector>

#include "trajopt/linalg/block_tridiagonal.h"
#include "trajopt/linalg/bordered.h"
#include "trajopt/linalg/factorization.h"
#include "trajopt/problem/frontal_kkt.h"
#include "trajopt/problem/step_rows.h"
#include "trajopt/problem/trajectory_problem.h"

namespace trajopt {

class KktSystem {
 public:
  static constexpr int kRefinements = 2;
  static constexpr int kRingReach = 1;  // a ring's last block meets its two neighbours only
  // Of the residual relative to the right-hand side: what the epsilon on the multipliers' diagonal
  // may leave. Rounding leaves 1e-12 to 1e-13, more of it the smaller the right-hand side is beside
  // the step; a tolerance below that is paid for with sweeps that improve nothing.
  static constexpr double kRefineTolerance = 1e-10;

  KktSystem(const TrajectoryProblem& problem, double smoothing, linalg::Ordering ordering);

  int primal() const { return primal_; }
  int dual() const { return dual_; }
  int nodes() const { return nodes_; }
  // Length of a right-hand side, padding included. Node i: multipliers at offset(i), tangent
  // behind.
  long rows() const { return static_cast<long>(blocks_) * size_; }
  long offset(int node) const { return static_cast<long>(node) * (primal_ + dual_); }

  // Whether Ordering::frontal can do it: frames, not periodic.
  static bool frontal_possible(const TrajectoryProblem& problem);

  // Writes H + damping W and A. Without lin's Hessian (identity = true; not frontal) writes
  // [W A^T; A 0]. A frontal system reads `lin` until the next call; it and no other wants a
  // linearization by nodes. Throws ArgumentError where `lin` is not in the form it reads.
  void assemble(const Linearization& lin, double damping, bool identity = false);

  // Factors with -epsilon on the multiplier diagonal; throws FactorizationError.
  void factor(double epsilon);

  // Solves in place for m right-hand sides, rhs (rows, m) row-major, with up to `refinements`
  // corrections against the matrix without epsilon. Allocates only when m grows.
  void solve(std::vector<double>& rhs, int m, int refinements = kRefinements);

  // factor(epsilon) and solve(rhs, m, refinements) in two calls, of which the first does already
  // what is cheaper while factors are in cache.
  void factor_and_begin(double epsilon, std::vector<double>& rhs, int m);
  void finish(std::vector<double>& rhs, int m, int refinements = kRefinements);

  // y = K x for the assembled matrix.
  void multiply(const std::vector<double>& x, std::vector<double>& y) const;

  // How the bodies of step_rows.h see the vectors of this system.
  StepRows step_rows(const double* gradient, const double* constraint, double* steps) const {
    return {nodes_, primal_, dual_, ring_, smoothing_, gradient, constraint, steps};
  }

  linalg::Ordering ordering() const;  // never automatic

 private:
  void check_form(const Linearization& lin, bool identity) const;
  void assemble_frames(const Linearization& lin, double damping, bool identity);
  void shift_multipliers(double by);  // adds to their diagonal
  void assemble_spline(const Linearization& lin, double damping, bool identity);
  void keep(const std::vector<double>& rhs, int m);  // for refine()
  void refine(std::vector<double>& solution, int m, int refinements);
  void refine_ring(std::vector<double>& solution, int m, int refinements);

  const TrajectoryProblem& problem_;
  double smoothing_;
  int nodes_, primal_, dual_, blocks_, size_, threads_;
  bool ring_;
  std::unique_ptr<FrontalKkt> frontal_;
  NodeRows node_rows_{};                      // of a frontal system; the others have
  linalg::SymmetricBlockTridiagonal matrix_;  // a ring keeps its last block in the border
  std::unique_ptr<linalg::Factorization> factorization_;
  std::unique_ptr<linalg::BorderedFactorization> bordered_;
  std::vector<double> border_, corner_;  // chain rows x size, size x size
  std::vector<signed char> signs_;
  std::vector<double> rhs_copy_, columns_;
  std::vector<double> scratch_;  // of the spline's assembly, per thread
};

}  // namespace trajopt
