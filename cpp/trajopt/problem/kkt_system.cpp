#include "trajopt/problem/kkt_system.h"

#include <algorithm>

#include "trajopt/base/error.h"
#include "trajopt/base/parallel.h"
#include "trajopt/problem/node_kernels.h"
#include "trajopt/problem/spline_kernels.h"

namespace trajopt {

using linalg::Factorization;
using linalg::Ordering;

bool KktSystem::frontal_possible(const TrajectoryProblem& problem) {
  const ProblemOptions& options = problem.options();
  return options.formulation == Formulation::frames && !options.periodic &&
         problem.objective().callbacks.empty();
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
      ordering_(ordering),
      matrix_(ordering == Ordering::frontal ? 1 : (ring_ ? blocks_ - 1 : blocks_), size_),
      signs_(rows(), 1) {
  for (int node = 0; node < nodes_; ++node)
    std::fill_n(signs_.begin() + offset(node), dual_, static_cast<signed char>(-1));
  if (ordering == Ordering::frontal) {
    if (!frontal_possible(problem))
      throw ArgumentError(
          "ordering = 'frontal': expected formulation frames, not periodic, without terms that are "
          "functions of the user");
    frontal_ = std::make_unique<FrontalKkt>(nodes_, primal_, dual_);
  } else if (ring_) {
    bordered_ =
        std::make_unique<linalg::BorderedFactorization>(blocks_ - 1, size_, size_, ordering);
    border_.resize(static_cast<std::size_t>(blocks_ - 1) * size_ * size_);
    corner_.resize(static_cast<std::size_t>(size_) * size_);
  } else {
    factorization_ = std::make_unique<Factorization>(blocks_, size_, ordering);
  }
  if (problem.options().formulation == Formulation::spline)
    scratch_.resize(threads_ * spline_row_scratch(problem.model().ndof));
}

Ordering KktSystem::ordering() const {
  return ring_ || frontal_ ? ordering_ : factorization_->ordering();
}

void KktSystem::put(int row_node, int row, int column_node, int column, int rows, int columns,
                    const double* block, int row_stride, int column_stride, double scale) {
  const int rg = row_node / 2, cg = column_node / 2;
  const int r0 = (row_node % 2) * (primal_ + dual_) + row;
  const int c0 = (column_node % 2) * (primal_ + dual_) + column;
  const int last = blocks_ - 1;
  double* target;
  bool lower_only = false, transposed = false;
  if (rg == cg) {
    target = ring_ && rg == last ? corner_.data() : matrix_.diagonal(rg);
    lower_only = true;
  } else if (ring_ && (rg == last || cg == last)) {  // border[chain row, border column]
    transposed = rg == last;
    target = border_.data() + static_cast<std::size_t>(transposed ? cg : rg) * size_ * size_;
  } else {
    transposed = rg < cg;
    target = matrix_.lower(std::min(rg, cg));
  }
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j < columns; ++j) {
      const double value = scale * block[i * row_stride + j * column_stride];
      const int r = r0 + i, c = c0 + j;
      if (lower_only && r < c) continue;
      target[transposed ? static_cast<long>(c) * size_ + r : static_cast<long>(r) * size_ + c] +=
          value;
    }
  }
}

void KktSystem::assemble(const Linearization& lin, double damping, bool identity) {
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
  if (ring_) {
    matrix_.set_zero();
    std::fill(border_.begin(), border_.end(), 0.0);
    std::fill(corner_.begin(), corner_.end(), 0.0);
    assemble_ring(lin, damping, identity);
  } else {
    assemble_frames(lin, damping, identity);
  }
}

void KktSystem::assemble_frames(const Linearization& lin, double damping, bool identity) {
  const KktRows rows{nodes_,
                     primal_,
                     dual_,
                     smoothing_,
                     damping,
                     identity ? nullptr : lin.hessian.data(),
                     lin.jacobian.data(),
                     matrix_.diagonal(0),
                     matrix_.lower(0)};
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

void KktSystem::assemble_ring(const Linearization& lin, double damping, bool identity) {
  const long d = primal_, m = dual_, n = nodes_;
  const auto window = [&](long f, int block) {
    return lin.hessian.data() + (f * 6 + block) * d * d;
  };
  // One block row at a time: a worker writes its own diagonal and the coupling to the block before.
  parallel_for(blocks_, threads_, [&](long group, int) {
    for (int i = static_cast<int>(2 * group); i < 2 * group + 2; ++i) {
      double w[3];
      metric_weights(smoothing_, i, nodes_, true, w);
      for (int back = 0; back < 3; ++back) {
        const int j = (i - back + nodes_) % nodes_;
        // Hessian block (x_i, x_{i-back}): windows of the frames that see both.
        if (!identity) {
          constexpr int kBlocks[3][3] = {{0, 3, 5}, {1, 4, -1}, {2, -1, -1}};
          for (int ahead = 0; ahead + back < 3; ++ahead) {
            const long f = (i + ahead) % n;
            put(i, dual_, j, dual_, primal_, primal_, window(f, kBlocks[back][ahead]), primal_, 1);
          }
        }
        const double one = damping * w[back];
        for (int k = 0; k < primal_; ++k) put(i, dual_ + k, j, dual_ + k, 1, 1, &one, 1, 1);
        // Constraint i by x_{i-back}. Its own multiplier stands before x_i: transposed there.
        const double* a = lin.jacobian.data() + (static_cast<long>(i) * 3 + back) * m * d;
        if (back == 0) {
          put(i, dual_, i, 0, primal_, dual_, a, 1, primal_);
        } else {
          put(i, 0, j, dual_, dual_, primal_, a, primal_, 1);
        }
      }
    }
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
  if (ring_) {
    solve_ring(rhs, m, refinements);
    return;
  }
  if (refinements > 0) {
    rhs_copy_.resize(rhs.size());
    const long block = static_cast<long>(size_) * m;
    parallel_for(blocks_, threads_, [&](long i, int) {
      std::copy_n(rhs.data() + i * block, block, rhs_copy_.data() + i * block);
    });
  }
  if (frontal_) {
    frontal_->solve(rhs.data(), m, threads_);
    if (refinements > 0)
      frontal_->refine(node_rows_, rhs_copy_.data(), rhs.data(), m, refinements, kRefineTolerance,
                       threads_);
    return;
  }
  factorization_->solve(rhs.data(), m, threads_);
  if (refinements == 0) return;
  factorization_->refine(matrix_, rhs_copy_.data(), rhs.data(), m, refinements, kRefineTolerance,
                         threads_);
}

void KktSystem::solve_ring(std::vector<double>& rhs, int m, int refinements) {
  // BorderedFactorization::refine would keep the epsilon of the border's own multipliers.
  const long n = rows(), chain = matrix_.rows();
  std::vector<double> b(n), x, r, before;
  for (int column = 0; column < m; ++column) {
    for (long i = 0; i < n; ++i) b[i] = rhs[i * m + column];
    x = b;
    bordered_->solve(x.data(), x.data() + chain, 1, threads_);
    const double size = linalg::largest_magnitude(b.data(), n, 1, 1);
    linalg::refine_loop(
        refinements, kRefineTolerance,
        [&] {
          multiply(x, r);
          for (long i = 0; i < n; ++i) r[i] = b[i] - r[i];
          return linalg::largest_magnitude(r.data(), n, 1, 1) / (size > 0 ? size : 1.0);
        },
        [&] {
          before = x;
          bordered_->solve(r.data(), r.data() + chain, 1, threads_);
          for (long i = 0; i < n; ++i) x[i] += r[i];
        },
        [&] { x = before; });
    for (long i = 0; i < n; ++i) rhs[i * m + column] = x[i];
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
