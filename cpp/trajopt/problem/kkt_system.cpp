#include "trajopt/problem/kkt_system.h"

#include <algorithm>
#include <string>

#include "trajopt/base/error.h"
#include "trajopt/base/parallel.h"
#include "trajopt/problem/node_kernels.h"
#include "trajopt/problem/spline_kernels.h"

namespace trajopt {

using linalg::Factorization;
using linalg::Ordering;

bool KktSystem::frontal_possible(const TrajectoryProblem& problem) {
  const ProblemOptions& options = problem.options();
  return options.formulation == Formulation::frames && !options.periodic;
}

KktSystem::KktSystem(const TrajectoryProblem& problem, double smoothing, Ordering ordering)
    : problem_(problem),
      smoothing_(problem.options().formulation == Formulation::frames ? smoothing : 0.0),
      nodes_(problem.nodes()),
      primal_(problem.primal()),
      dual_(problem.dual()),
      blocks_((nodes_ + 1) / 2),
      size_(2 * (primal_ + dual_)),
      threads_(std::max(problem.options().threads, 1)),
      ring_(problem.options().periodic),
      matrix_(ordering == Ordering::frontal ? 1 : (ring_ ? blocks_ - 1 : blocks_), size_),
      signs_(rows(), 1) {
  for (int node = 0; node < nodes_; ++node)
    std::fill_n(signs_.begin() + offset(node), dual_, static_cast<signed char>(-1));
  if (ordering == Ordering::frontal) {
    if (!frontal_possible(problem))
      throw ArgumentError("ordering = 'frontal': expected formulation frames, not periodic");
    frontal_ = std::make_unique<FrontalKkt>(nodes_, primal_, dual_);
  } else if (ring_) {
    bordered_ = std::make_unique<linalg::BorderedFactorization>(blocks_ - 1, size_, size_, ordering,
                                                                2, Isa::avx512, kRingReach);
    border_.resize(static_cast<std::size_t>(blocks_ - 1) * size_ * size_);
    corner_.resize(static_cast<std::size_t>(size_) * size_);
  } else {
    factorization_ = std::make_unique<Factorization>(blocks_, size_, ordering);
  }
  if (problem.options().formulation == Formulation::spline)
    scratch_.resize(threads_ * spline_row_scratch(problem.model().ndof));
}

Ordering KktSystem::ordering() const {
  if (frontal_) return Ordering::frontal;
  return ring_ ? bordered_->ordering() : factorization_->ordering();
}

void KktSystem::assemble(const Linearization& lin, double damping, bool identity) {
  check_form(lin, identity);
  if (frontal_) {
    node_rows_ = {nodes_, primal_, dual_, smoothing_, damping, lin.node_rows.data()};
    return;
  }
  if (identity) damping = 1.0;
  if (problem_.options().formulation == Formulation::spline) {
    assemble_spline(lin, damping, identity);
    return;
  }
  if (nodes_ % 2 != 0) {  // the half block that pads an odd count is the identity
    double* d = matrix_.diagonal(blocks_ - 1);
    for (int i = size_ / 2; i < size_; ++i) d[static_cast<long>(i) * size_ + i] = 1;
  }
  assemble_frames(lin, damping, identity);
}

void KktSystem::check_form(const Linearization& lin, bool identity) const {
  if (lin.by_nodes != (frontal_ != nullptr)) {
    throw ArgumentError(frontal_ ? "by_nodes = false, expected true: ordering 'frontal' eliminates "
                                   "a linearization by nodes"
                                 : "by_nodes = true, expected false: only ordering 'frontal' "
                                   "eliminates a linearization by nodes");
  }
  if (!frontal_) return;
  if (identity) throw ArgumentError("identity = true, expected false: ordering 'frontal' needs H");
  const std::size_t expected = nodes_ * NodeRows{nodes_, primal_, dual_, 0, 0, nullptr}.length();
  if (lin.node_rows.size() < expected) {
    throw ArgumentError("node_rows holds " + std::to_string(lin.node_rows.size()) +
                        " numbers, expected at least " + std::to_string(expected) + " of " +
                        std::to_string(nodes_) + " nodes: linearize() writes them");
  }
}

void KktSystem::assemble_frames(const Linearization& lin, double damping, bool identity) {
  const KktRows rows{nodes_,
                     primal_,
                     dual_,
                     ring_,
                     smoothing_,
                     damping,
                     identity ? nullptr : lin.hessian.data(),
                     lin.jacobian.data(),
                     matrix_.diagonal(0),
                     matrix_.lower(0),
                     ring_ ? border_.data() : nullptr,
                     ring_ ? corner_.data() : nullptr};
  const NodeKernels& kernels = node_kernels();
  parallel_for(blocks_, threads_, [&](long g, int) { kernels.write_block_row(rows, g); });
}

void KktSystem::assemble_spline(const Linearization& lin, double damping, bool identity) {
  const int d = problem_.model().ndof;
  const SplineRows rows{problem_.spline().view(),
                        d,
                        dual_ / 2,
                        damping,
                        identity ? nullptr : lin.hessian.data(),
                        lin.jacobian.data(),
                        matrix_.diagonal(0),
                        matrix_.lower(0)};
  const SplineKernels& kernels = spline_kernels();
  parallel_for(blocks_, threads_, [&](long g, int worker) {
    kernels.write_block_row(rows, g, scratch_.data() + worker * spline_row_scratch(d));
  });
}

void KktSystem::shift_multipliers(double by) {
  const int width = primal_ + dual_;
  parallel_for(blocks_, threads_, [&](long g, int) {
    double* block =
        ring_ && g + 1 == blocks_ ? corner_.data() : matrix_.diagonal(static_cast<int>(g));
    for (int half = 0; half < 2 && 2 * g + half < nodes_; ++half) {
      const int first = half * width;
      for (int k = first; k < first + dual_; ++k) block[static_cast<long>(k) * size_ + k] += by;
    }
  });
}

void KktSystem::factor(double epsilon) {
  if (frontal_) return frontal_->factor(node_rows_, epsilon, threads_);
  // -epsilon on the multipliers only: added to the matrix itself, taken out again by refinement.
  // The entries are zero otherwise, so taking it back leaves no rounding.
  shift_multipliers(-epsilon);
  try {
    if (ring_) {
      bordered_->factor(matrix_, border_.data(), corner_.data(), signs_.data(),
                        signs_.data() + matrix_.rows(), 0.0, threads_);
    } else {
      factorization_->factor(matrix_, signs_.data(), 0.0, threads_);
    }
  } catch (...) {
    shift_multipliers(epsilon);
    throw;
  }
  shift_multipliers(epsilon);
}

void KktSystem::solve(std::vector<double>& rhs, int m, int refinements) {
  if (refinements > 0) keep(rhs, m);
  if (frontal_) {
    frontal_->solve(rhs.data(), m, threads_);
  } else if (ring_) {
    bordered_->solve(rhs.data(), rhs.data() + matrix_.rows() * m, m, threads_);
  } else {
    factorization_->solve(rhs.data(), m, threads_);
  }
  if (refinements > 0) refine(rhs, m, refinements);
}

void KktSystem::factor_and_begin(double epsilon, std::vector<double>& rhs, int m) {
  if (!frontal_) return factor(epsilon);
  keep(rhs, m);
  frontal_->factor_and_begin(node_rows_, epsilon, rhs.data(), m, threads_);
}

void KktSystem::finish(std::vector<double>& rhs, int m, int refinements) {
  if (!frontal_) return solve(rhs, m, refinements);
  frontal_->finish(rhs.data(), m, threads_);
  if (refinements > 0) refine(rhs, m, refinements);
}

void KktSystem::keep(const std::vector<double>& rhs, int m) {
  rhs_copy_.resize(rhs.size());
  const long block = static_cast<long>(size_) * m;
  parallel_for(blocks_, threads_, [&](long i, int) {
    std::copy_n(rhs.data() + i * block, block, rhs_copy_.data() + i * block);
  });
}

void KktSystem::refine(std::vector<double>& solution, int m, int refinements) {
  if (frontal_) {
    frontal_->refine(node_rows_, rhs_copy_.data(), solution.data(), m, refinements,
                     kRefineTolerance, threads_);
  } else if (ring_) {
    refine_ring(solution, m, refinements);
  } else {
    factorization_->refine(matrix_, rhs_copy_.data(), solution.data(), m, refinements,
                           kRefineTolerance, threads_);
  }
}

// Column by column, each with decisions of its own.
void KktSystem::refine_ring(std::vector<double>& solution, int m, int refinements) {
  const long n = rows(), chain = matrix_.rows();
  columns_.resize(2 * n);
  double *b = columns_.data(), *x = b + n;
  for (int column = 0; column < m; ++column) {
    for (long i = 0; i < n; ++i) {
      b[i] = rhs_copy_[i * m + column];
      x[i] = solution[i * m + column];
    }
    bordered_->refine(matrix_, corner_.data(), b, b + chain, x, x + chain, refinements,
                      kRefineTolerance, threads_);
    for (long i = 0; i < n; ++i) solution[i * m + column] = x[i];
  }
}

void KktSystem::multiply(const std::vector<double>& x, std::vector<double>& y) const {
  y.resize(x.size());
  if (frontal_) {
    frontal_->residual(node_rows_, nullptr, x.data(), y.data(), 1, threads_);
    for (double& value : y) value = -value;
    std::copy(x.begin() + offset(nodes_), x.end(), y.begin() + offset(nodes_));  // padding
    return;
  }
  if (!ring_) {
    matrix_.matmul(x.data(), y.data(), 1, threads_);
    return;
  }
  matrix_.matmul(x.data(), y.data(), 1, threads_);
  const long chain = matrix_.rows();
  const double* xb = x.data() + chain;
  double* yb = y.data() + chain;
  for (int i = 0; i < size_; ++i) {
    double sum = 0;
    for (int j = 0; j < size_; ++j)
      sum += corner_[static_cast<long>(std::max(i, j)) * size_ + std::min(i, j)] * xb[j];
    yb[i] = sum;
  }
  for (long r = 0; r < chain; ++r) {
    const double* e = border_.data() + r * size_;
    for (int j = 0; j < size_; ++j) {
      y[r] += e[j] * xb[j];
      yb[j] += e[j] * x[r];
    }
  }
}

}  // namespace trajopt
