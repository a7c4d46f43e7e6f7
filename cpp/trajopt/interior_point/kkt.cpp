#include "trajopt/interior_point/kkt.h"

#include <algorithm>
#include <cmath>

#include "trajopt/base/error.h"
#include "trajopt/linalg/refinement.h"
#include "trajopt/solver/stopwatch.h"

namespace trajopt::interior_point {

namespace {

constexpr double kRefineTolerance = 1e-10;  // relative to the right-hand side

double largest(const std::vector<double>& x) {
  double most = 0.0;
  for (double v : x) most = std::max(most, std::abs(v));
  return most;
}

double largest(const double* x, int size) {
  double most = 0.0;
  for (int i = 0; i < size; ++i) most = std::max(most, std::abs(x[i]));
  return most;
}

}  // namespace

Kkt::Kkt(const ScaledProblem& problem, linalg::Ordering ordering, int threads)
    : problem_(problem),
      variables_(problem.variables()),
      rows_(problem.rows()),
      nodes_(problem.problem().nodes),
      size_(problem.problem().node_size),
      globals_(problem.problem().globals),
      threads_(threads),
      kernels_(linalg::block_kernels(Isa::avx512)),
      matrix_(nodes_, size_),
      diagonal_(variables_),
      weight_(rows_),
      r1_(variables_),
      r2_(rows_),
      dx_(variables_),
      dl_(rows_),
      rhs_(variables_) {
  if (globals_ > 0) {
    bordered_ = std::make_unique<linalg::BorderedFactorization>(nodes_, size_, globals_, ordering);
    border_.resize(static_cast<std::size_t>(nodes_) * size_ * globals_);
    corner_.resize(static_cast<std::size_t>(globals_) * globals_);
  } else {
    plain_ = std::make_unique<linalg::Factorization>(nodes_, size_, ordering);
  }
  for (int i = 0; i < 3; ++i) {
    const auto& terms = problem.terms()[i];
    Local& local = local_[i];
    local.ld = linalg::padded(terms.locals);
    local.hessian = linalg::BlockBuffer(local.ld * terms.locals);
    local.share = linalg::BlockBuffer(local.ld * terms.locals);
    local.jacobian = linalg::BlockBuffer(local.ld * terms.part->constraints);
    local.weighted = linalg::BlockBuffer(local.ld * terms.part->constraints);
  }
}

void Kkt::add_copy(const ScaledProblem::Terms& t, int k, bool with_hessian) {
  const Part& part = *t.part;
  Local& local = local_[2 - part.span];
  const long ld = local.ld;
  const int nj = part.jacobian.nonzeros(), nh = part.hessian.nonzeros(), rows = part.constraints;
  const double* j = t.jacobian.data() + static_cast<long>(k) * nj;
  const double* weight = weight_.data() + t.first_row + k * rows;
  for (int e = 0; e < nj; ++e) {
    const int row = part.jacobian.row[e];
    const long place = row * ld + part.jacobian.column[e];
    local.jacobian.data()[place] = j[e];
    local.weighted.data()[place] = -weight[row] * j[e];
  }
  const double* h = t.hessian.data() + static_cast<long>(k) * nh;
  for (int e = 0; e < nh; ++e) {
    local.hessian.data()[part.hessian.row[e] * ld + part.hessian.column[e]] =
        with_hessian ? h[e] : 0.0;
  }
  const double* m = local.hessian.data();
  if (rows > 0) {
    kernels_.update(t.locals, t.locals, rows, m, ld, local.share.data(), ld, local.jacobian.data(),
                    ld, local.weighted.data(), ld, true);
    m = local.share.data();
  }
  const int seen = part.span * size_, first = t.first_node + k;
  for (int a = 0; a < part.span; ++a) {
    double* d = matrix_.diagonal(first + a);
    for (int r = 0; r < size_; ++r) {
      const double* row = m + (a * size_ + r) * ld + a * size_;
      for (int c = 0; c <= r; ++c) d[r * size_ + c] += row[c];
    }
  }
  if (part.span == 2) {
    double* l = matrix_.lower(first);
    for (int r = 0; r < size_; ++r) std::copy_n(m + (size_ + r) * ld, size_, l + r * size_);
  }
  for (int g = 0; g < globals_; ++g) {
    const double* row = m + (seen + g) * ld;
    double* b = border_.data() + static_cast<long>(first) * size_ * globals_ + g;
    for (int c = 0; c < seen; ++c) b[static_cast<long>(c) * globals_] += row[c];
    for (int c = 0; c <= g; ++c) corner_[g * globals_ + c] += row[seen + c];
  }
}

void Kkt::assemble(const double* diagonal, bool with_hessian) {
  matrix_.set_zero();
  std::fill(border_.begin(), border_.end(), 0.0);
  std::fill(corner_.begin(), corner_.end(), 0.0);
  for (const auto& terms : problem_.terms()) {
    for (int k = 0; k < terms.part->count; ++k) add_copy(terms, k, with_hessian);
  }
  for (int i = 0; i < variables_; ++i) diagonal_[i] = problem_.pinned(i) ? 1.0 : diagonal[i];
  for (int node = 0; node < nodes_; ++node) {
    double* d = matrix_.diagonal(node);
    for (int r = 0; r < size_; ++r) d[r * (size_ + 1)] += diagonal_[node * size_ + r];
  }
  for (int g = 0; g < globals_; ++g) {
    corner_[g * (globals_ + 1)] += diagonal_[nodes_ * size_ + g];
  }
}

bool Kkt::factor(const double* diagonal, const double* regularized, bool with_hessian) {
  Stopwatch watch;
  with_hessian_ = with_hessian;
  for (int i = 0; i < rows_; ++i) weight_[i] = 1.0 / regularized[i];
  assemble(diagonal, with_hessian);
  assembly_seconds += watch.lap();
  bool good = true;
  try {
    if (plain_) {
      plain_->factor(matrix_, nullptr, 0.0, threads_);
    } else {
      bordered_->factor(matrix_, border_.data(), corner_.data(), nullptr, nullptr, 0.0, threads_);
    }
  } catch (const FactorizationError&) {
    good = false;
  }
  factorization_seconds += watch.lap();
  return good;
}

void Kkt::condensed_solve(const double* b1, const double* b2, double* dx, double* dl) {
  for (int i = 0; i < rows_; ++i) dl[i] = weight_[i] * b2[i];
  std::copy_n(b1, variables_, rhs_.data());
  problem_.add_jacobian_transposed_product(dl, rhs_.data());
  for (int i = 0; i < variables_; ++i) {
    if (problem_.pinned(i)) rhs_[i] = 0.0;
  }
  if (plain_) {
    plain_->solve(rhs_.data(), 1, threads_);
  } else {
    bordered_->solve(rhs_.data(), rhs_.data() + nodes_ * size_, 1, threads_);
  }
  std::copy_n(rhs_.data(), variables_, dx);
  for (int i = 0; i < rows_; ++i) dl[i] = -b2[i];
  problem_.add_jacobian_product(dx, dl);
  for (int i = 0; i < rows_; ++i) dl[i] *= weight_[i];
}

double Kkt::residual(const double* b1, const double* b2, const double* e, const double* dx,
                     const double* dl) {
  std::fill(r1_.begin(), r1_.end(), 0.0);
  problem_.add_jacobian_transposed_product(dl, r1_.data());
  if (with_hessian_) problem_.add_hessian_product(dx, r1_.data());
  for (int i = 0; i < variables_; ++i) {
    r1_[i] = problem_.pinned(i) ? 0.0 : b1[i] - r1_[i] - diagonal_[i] * dx[i];
  }
  std::fill(r2_.begin(), r2_.end(), 0.0);
  problem_.add_jacobian_product(dx, r2_.data());
  for (int i = 0; i < rows_; ++i) r2_[i] = b2[i] - r2_[i] + e[i] * dl[i];
  return std::max(largest(r1_), largest(r2_));
}

double Kkt::solve(const double* b1, const double* b2, const double* e, double* dx, double* dl,
                  int max_steps) {
  condensed_solve(b1, b2, dx, dl);
  const double size = std::max(largest(b1, variables_), largest(b2, rows_));
  const double scale = size > 0.0 ? 1.0 / size : 1.0;
  const auto result = linalg::refine_loop(
      max_steps, kRefineTolerance, [&] { return scale * residual(b1, b2, e, dx, dl); },
      [&] {
        condensed_solve(r1_.data(), r2_.data(), dx_.data(), dl_.data());
        for (int i = 0; i < variables_; ++i) dx[i] += dx_[i];
        for (int i = 0; i < rows_; ++i) dl[i] += dl_[i];
      },
      [&] {
        for (int i = 0; i < variables_; ++i) dx[i] -= dx_[i];
        for (int i = 0; i < rows_; ++i) dl[i] -= dl_[i];
      });
  return result.residual;
}

}  // namespace trajopt::interior_point
