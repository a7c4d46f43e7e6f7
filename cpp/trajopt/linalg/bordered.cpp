#include "trajopt/linalg/bordered.h"

#include <algorithm>
#include <string>

#include "trajopt/base/error.h"
#include "trajopt/base/group.h"
#include "trajopt/base/parallel.h"
#include "trajopt/linalg/pivot_error.h"

namespace trajopt::linalg {

BorderedFactorization::BorderedFactorization(int blocks, int size, int border, Ordering ordering,
                                             int chunks, Isa isa, int reach)
    : inner_(blocks, size, ordering, chunks, 1, isa),
      border_(border),
      reach_(reach),
      columns_((border + 7) / 8 * 8),
      ld_(padded(border)),
      kernels_(&block_kernels(isa)) {
  if (border < 1) {
    throw ArgumentError("a border needs at least one unknown, not " + std::to_string(border));
  }
  if (reach < 0 || 2 * reach > blocks) {
    throw ArgumentError("a border's reach is at most half of " + std::to_string(blocks) +
                        " blocks, not " + std::to_string(reach));
  }
  e_ = BlockBuffer(rows() * columns_);
  z_ = BlockBuffer(rows() * columns_);
  f_ = BlockBuffer(static_cast<std::size_t>(border) * border);
  schur_ = BlockBuffer(border * ld_);
  packed_ = BlockBuffer(PackedTriangle<double>::length(border));
  unscaled_ = BlockBuffer(border * ld_);
  inverse_ = BlockBuffer(border);
  residual_ = BlockBuffer(rows() + border);
  saved_ = BlockBuffer(rows() + border);
}

template <class Body>
void BorderedFactorization::for_rows(const Body& body) const {
  const long all = rows(), reached = reach_ > 0 ? static_cast<long>(reach_) * size() : all;
  if (reached < all) body(all - reached, static_cast<int>(reached));
  body(0, static_cast<int>(reached));
}

void BorderedFactorization::factor(const SymmetricBlockTridiagonal& k, const double* e,
                                   const double* f, const signed char* signs,
                                   const signed char* border_signs, double regularization,
                                   int threads) {
  factored_ = false;
  inner_.factor(k, signs, regularization, threads);
  const Pivot pivot = factor_border(e, f, border_signs, regularization, threads);
  if (!factored_) {
    const bool positive = !border_signs || border_signs[pivot.row] > 0;
    throw border_pivot_error(-1, blocks(), pivot.row, pivot.value, positive, regularization);
  }
}

bool BorderedFactorization::try_factor(const SymmetricBlockTridiagonal& k, const double* e,
                                       const double* f, const signed char* signs,
                                       const signed char* border_signs, double regularization,
                                       int threads) {
  factored_ = false;
  if (inner_.try_factor(k, signs, regularization, threads)) {
    factor_border(e, f, border_signs, regularization, threads);
  }
  return factored_;
}

// S = F - Et K^-1 E and its factors; the pivot that failed, if one did.
Pivot BorderedFactorization::factor_border(const double* e, const double* f,
                                           const signed char* border_signs, double regularization,
                                           int threads) {
  for (long i = 0; i < rows(); ++i) {
    std::copy_n(e + i * border_, border_, e_.data() + i * columns_);
  }
  std::copy_n(f, f_.size(), f_.data());
  std::copy_n(e_.data(), e_.size(), z_.data());
  inner_.solve(z_.data(), static_cast<int>(columns_), threads);
  const double* source = f_.data();
  for_rows([&](long first, int count) {
    const long at = first * columns_;
    kernels_->update(border_, border_, count, source, source == f_.data() ? border_ : ld_,
                     schur_.data(), ld_, e_.data() + at, columns_, z_.data() + at, columns_, true);
    source = schur_.data();
  });
  Elimination s;
  s.size = border_;
  s.ld = ld_;
  s.diagonal = schur_.data();
  s.diagonal_ld = ld_;
  s.original = f_.data();
  s.original_step = border_ + 1L;
  s.signs = border_signs;
  s.regularization = regularization;
  s.w = packed_.data();
  s.u = unscaled_.data();
  s.inverse = inverse_.data();
  const Pivot pivot = kernels_->eliminate(s);
  factored_ = pivot.row < 0;
  return pivot;
}

void BorderedFactorization::solve(double* z, double* y, int m, int threads) const {
  if (!factored_) throw ArgumentError("solve: there is no factorization, factor() has to succeed");
  if (m < 1) return;
  inner_.solve(z, m, threads);
  for_rows([&](long first, int count) {
    kernels_->subtract_transposed(count, border_, e_.data() + first * columns_, columns_,
                                  z + first * m, y, m, m, m, 0);
  });
  kernels_->substitute_transposed(border_, packed_.data(), y, m, m, 0);
  for (int i = 0; i < border_; ++i) {
    for (int j = 0; j < m; ++j) y[static_cast<long>(i) * m + j] *= inverse_.data()[i];
  }
  kernels_->substitute(border_, packed_.data(), y, m, m, 0);
  parallel_for(blocks(), threads, [&](long i, int) {
    kernels_->subtract(size(), border_, z_.data() + i * size() * columns_, columns_, y,
                       z + i * size() * m, m, m, m, 0);
  });
}

Refinement BorderedFactorization::refine(const SymmetricBlockTridiagonal& k, const double* f,
                                         const double* rhs_z, const double* rhs_y, double* z,
                                         double* y, int max_steps, double tolerance, int threads) {
  std::copy_n(f, f_.size(), f_.data());  // the kernels read beyond the last row
  double* r_z = residual_.data();
  double* r_y = r_z + rows();
  double* saved_z = saved_.data();
  double* saved_y = saved_z + rows();
  const auto norm = [&](const double* of_z, const double* of_y) {
    return largest(largest_magnitude(of_z, rows(), 1, 1), largest_magnitude(of_y, border_, 1, 1));
  };
  const double size = norm(rhs_z, rhs_y);
  const double scale = size > 0.0 ? size : 1.0;
  const auto evaluate = [&] {
    std::copy_n(rhs_z, rows(), r_z);
    std::copy_n(rhs_y, border_, r_y);
    k.subtract_product(0, z, r_z, 1, 1, 1, threads);
    for_rows([&](long first, int count) {
      const double* e = e_.data() + first * columns_;
      kernels_->subtract(count, border_, e, columns_, y, r_z + first, 1, 1, 1, 0);
      kernels_->subtract_transposed(count, border_, e, columns_, z + first, r_y, 1, 1, 1, 0);
    });
    kernels_->subtract_symmetric(border_, f_.data(), border_, y, r_y, 1, 1, 1, 0);
    return norm(r_z, r_y) / scale;
  };
  const auto correct = [&] {
    solve(r_z, r_y, 1, threads);
    std::copy_n(z, rows(), saved_z);
    std::copy_n(y, border_, saved_y);
    for (long i = 0; i < rows(); ++i) z[i] += r_z[i];
    for (int i = 0; i < border_; ++i) y[i] += r_y[i];
  };
  const auto undo = [&] {
    std::copy_n(saved_z, rows(), z);
    std::copy_n(saved_y, border_, y);
  };
  return refine_loop(max_steps, tolerance, evaluate, correct, undo);
}

}  // namespace trajopt::linalg
