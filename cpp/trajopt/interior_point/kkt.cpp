#include "trajopt/interior_point/kkt.h"

#include <algorithm>
#include <cfloat>
#include <cmath>

#include "trajopt/solver/stopwatch.h"

namespace trajopt::interior_point {

namespace {

constexpr double kTolerance = 1e-10;    // of the residual, relative to the right-hand side
constexpr double kRowTolerance = 1e-6;  // of the rows', relative to theirs, which may be small
constexpr double kRowRounding = 1e-14;  // and to the step
constexpr double kLeastGain = 0.02;     // share of the squared residual a correction must take away

double largest(const double* x, int size) {
  double most = 0.0;
  for (int i = 0; i < size; ++i) most = std::max(most, std::abs(x[i]));
  return most;
}

// In four sums, each in order.
double dot(const double* a, const double* b, int size) {
  double s0 = 0.0, s1 = 0.0, s2 = 0.0, s3 = 0.0;
  int i = 0;
  for (; i + 4 <= size; i += 4) {
    s0 += a[i] * b[i];
    s1 += a[i + 1] * b[i + 1];
    s2 += a[i + 2] * b[i + 2];
    s3 += a[i + 3] * b[i + 3];
  }
  for (; i < size; ++i) s0 += a[i] * b[i];
  return (s0 + s1) + (s2 + s3);
}

}  // namespace

Kkt::Kkt(const ScaledProblem& problem, linalg::Ordering ordering, int threads, int refinements)
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
      corrections_(refinements),
      residual_(variables_ + rows_),
      rhs_(variables_) {
  for (Correction& c : corrections_) {
    c.z = std::make_unique_for_overwrite<double[]>(variables_ + rows_);
    c.q = std::make_unique_for_overwrite<double[]>(variables_ + rows_);
  }
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
  const bool good = plain_ ? plain_->try_factor(matrix_, nullptr, 0.0, threads_)
                           : bordered_->try_factor(matrix_, border_.data(), corner_.data(), nullptr,
                                                   nullptr, 0.0, threads_);
  factorization_seconds += watch.lap();
  return good;
}

// Also J dx, which comes by the way.
void Kkt::condensed_solve(const double* b1, const double* b2, double* dx, double* dl, double* jdx) {
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
  std::fill_n(jdx, rows_, 0.0);
  problem_.add_jacobian_product(dx, jdx);
  for (int i = 0; i < rows_; ++i) dl[i] = weight_[i] * (jdx[i] - b2[i]);
}

// y = (K dx + J^T dl, J dx - E dl) where y2 is J dx at entry.
void Kkt::product(const double* e, const double* dx, const double* dl, double* y1,
                  double* y2) const {
  for (int i = 0; i < variables_; ++i) y1[i] = diagonal_[i] * dx[i];
  problem_.add_jacobian_transposed_product(dl, y1);
  if (with_hessian_) problem_.add_hessian_product(dx, y1);
  for (int i = 0; i < variables_; ++i) {
    if (problem_.pinned(i)) y1[i] = 0.0;
  }
  for (int i = 0; i < rows_; ++i) y2[i] -= e[i] * dl[i];
}

// Adds the step-th correction; false: the residual did not get much smaller.
bool Kkt::correct(int step, const double* e, const Weights& w, double* dx, double* dl) {
  const int size = variables_ + rows_;
  Correction& c = corrections_[step];
  double *r = residual_.data(), *z = c.z.get(), *q = c.q.get();
  const auto product_of = [&](const double* a, const double* b) {
    return w.x * w.x * dot(a, b, variables_) +
           w.rows * w.rows * dot(a + variables_, b + variables_, rows_);
  };
  condensed_solve(r, r + variables_, z, z + variables_, q + variables_);
  product(e, z, z + variables_, q, q + variables_);
  for (int j = 0; j < step; ++j) {
    const Correction& before = corrections_[j];
    const double share = product_of(q, before.q.get()) * before.inverse;
    for (int i = 0; i < size; ++i) {
      q[i] -= share * before.q[i];
      z[i] -= share * before.z[i];
    }
  }
  const double squared = product_of(q, q), along = product_of(r, q);
  if (!(squared > 0.0)) return false;
  c.inverse = 1.0 / squared;
  const double share = along * c.inverse, before = product_of(r, r);
  for (int i = 0; i < size; ++i) r[i] -= share * q[i];
  for (int i = 0; i < variables_; ++i) dx[i] += share * z[i];
  for (int i = 0; i < rows_; ++i) dl[i] += share * z[variables_ + i];
  return share * along > kLeastGain * before;
}

bool Kkt::solve(const double* b1, const double* b2, const double* e, double* dx, double* dl) {
  double* r1 = residual_.data();
  double* r2 = r1 + variables_;
  condensed_solve(b1, b2, dx, dl, r2);
  product(e, dx, dl, r1, r2);
  for (int i = 0; i < variables_; ++i) r1[i] = problem_.pinned(i) ? 0.0 : b1[i] - r1[i];
  for (int i = 0; i < rows_; ++i) r2[i] = b2[i] - r2[i];
  const double size2 = largest(b2, rows_);
  const double target1 = kTolerance * std::max({largest(b1, variables_), size2, DBL_MIN});
  const double target2 = std::max(
      {kRowRounding * largest(dx, variables_), std::min(target1, kRowTolerance * size2), DBL_MIN});
  const Weights w{1.0 / target1, 1.0 / target2};
  const auto error = [&] {
    return std::max(w.x * largest(r1, variables_), w.rows * largest(r2, rows_));
  };
  const int most = static_cast<int>(corrections_.size());
  for (int step = 0; step < most && error() > 1.0; ++step) {
    if (!correct(step, e, w, dx, dl)) break;
  }
  return std::isfinite(error());
}

}  // namespace trajopt::interior_point
