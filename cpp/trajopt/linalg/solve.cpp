// Solution with the factors, and iterative refinement.
#include <algorithm>
#include <cmath>

#include "trajopt/base/error.h"
#include "trajopt/base/parallel.h"
#include "trajopt/linalg/factorization.h"

namespace trajopt::linalg {

namespace {

double largest(const double* x, long rows, int columns, long ld) {
  double most = 0.0;
  for (long i = 0; i < rows; ++i) {
    for (int j = 0; j < columns; ++j) {
      const double value = std::abs(x[i * ld + j]);
      if (!(value <= most)) most = value;  // keeps a NaN
      if (std::isnan(most)) return most;
    }
  }
  return most;
}

}  // namespace

// Eliminates a block's unknowns from the equations after it. The update of a deferred left
// neighbour is the caller's.
void Factorization::forward(int item, const Step& step, double* x, int m) const {
  double* xi = x + static_cast<long>(step.block) * size_ * m;
  kernels_->substitute_transposed(size_, w(item, step.block), ld_, xi, m, m);
  if (step.right >= 0) {
    kernels_->subtract_transposed(size_, coupling(item, right_slot_[step.block]), ld_, xi,
                                  x + static_cast<long>(step.right) * size_ * m, m, m, m);
  }
  if (step.left >= 0 && !step.left_deferred) {
    kernels_->subtract_transposed(size_, coupling(item, left_slot_[step.block]), ld_, xi,
                                  x + static_cast<long>(step.left) * size_ * m, m, m, m);
  }
}

void Factorization::backward(int item, const Step& step, double* x, int m) const {
  double* xi = x + static_cast<long>(step.block) * size_ * m;
  const double* inverse = inverse_.data() + (static_cast<long>(item) * blocks_ + step.block) * size_;
  for (int k = 0; k < size_; ++k) {
    for (int j = 0; j < m; ++j) xi[static_cast<long>(k) * m + j] *= inverse[k];
  }
  if (step.left >= 0) {
    kernels_->subtract(size_, coupling(item, left_slot_[step.block]), ld_,
                       x + static_cast<long>(step.left) * size_ * m, xi, m, m, m);
  }
  if (step.right >= 0) {
    kernels_->subtract(size_, coupling(item, right_slot_[step.block]), ld_,
                       x + static_cast<long>(step.right) * size_ * m, xi, m, m, m);
  }
  kernels_->substitute(size_, w(item, step.block), ld_, xi, m, m);
}

void Factorization::solve_item(int item, double* x, int m, int threads) const {
  if (!factored_) throw ArgumentError("solve: there is no factorization, factor() has to succeed");
  if (m < 1) return;
  for (const Stage& stage : schedule_.stages) {
    const int runs = stage.end - stage.begin;
    parallel_for(runs, threads, [&](long slot, int) {
      const Run& run = schedule_.runs[stage.begin + slot];
      for (int s = run.begin; s < run.end; ++s) forward(item, schedule_.steps[s], x, m);
    });
    parallel_for(runs, threads, [&](long slot, int) {
      const Step& step = schedule_.steps[schedule_.runs[stage.begin + slot].end - 1];
      if (!step.left_deferred) return;
      kernels_->subtract_transposed(size_, coupling(item, left_slot_[step.block]), ld_,
                                    x + static_cast<long>(step.block) * size_ * m,
                                    x + static_cast<long>(step.left) * size_ * m, m, m, m);
    });
  }
  for (auto stage = schedule_.stages.rbegin(); stage != schedule_.stages.rend(); ++stage) {
    parallel_for(stage->end - stage->begin, threads, [&](long slot, int) {
      const Run& run = schedule_.runs[stage->begin + slot];
      for (int s = run.end - 1; s >= run.begin; --s) backward(item, schedule_.steps[s], x, m);
    });
  }
}

void Factorization::solve(double* rhs, int m, int threads) const {
  const long count = static_cast<long>(blocks_) * size_ * m;
  if (batch_ == 1) return solve_item(0, rhs, m, threads);
  if (!factored_) throw ArgumentError("solve: there is no factorization, factor() has to succeed");
  parallel_for(batch_, threads, [&](long item, int) {
    solve_item(static_cast<int>(item), rhs + item * count, m, 1);
  });
}

double Factorization::refine_item(const SymmetricBlockTridiagonal& a, int item, const double* rhs,
                                  double* x, int m, int max_steps, double tolerance, int threads,
                                  int& steps) {
  const long rows = a.rows();
  double* r = residual_.data();
  double* saved = saved_.data();
  double worst = 0.0;
  for (int c = 0; c < m; c += kRefineColumns) {
    const int columns = std::min(kRefineColumns, m - c);
    const double scale = std::max(largest(rhs + c, rows, columns, m), 1e-300);
    const auto evaluate = [&] {
      for (long i = 0; i < rows; ++i) {
        for (int j = 0; j < columns; ++j) r[i * columns + j] = rhs[i * m + c + j];
      }
      a.subtract_product(item, x + c, r, columns, m, columns, threads);
      return largest(r, rows, columns, columns) / scale;
    };
    double residual = evaluate();
    for (int k = 0; k < max_steps && !(residual <= tolerance); ++k) {
      for (long i = 0; i < rows; ++i) {
        for (int j = 0; j < columns; ++j) saved[i * columns + j] = x[i * m + c + j];
      }
      solve_item(item, r, columns, threads);
      for (long i = 0; i < rows; ++i) {
        for (int j = 0; j < columns; ++j) x[i * m + c + j] += r[i * columns + j];
      }
      const double before = residual;
      residual = evaluate();
      if (!(residual < before)) {
        for (long i = 0; i < rows; ++i) {
          for (int j = 0; j < columns; ++j) x[i * m + c + j] = saved[i * columns + j];
        }
        residual = before;
        break;
      }
      steps = std::max(steps, k + 1);
      if (residual > 0.5 * before) break;
    }
    if (!(residual <= worst)) worst = residual;
  }
  return worst;
}

Refinement Factorization::refine(const SymmetricBlockTridiagonal& a, const double* rhs, double* x,
                                 int m, int max_steps, double tolerance, int threads) {
  if (a.blocks() != blocks_ || a.size() != size_ || a.batch() != batch_) {
    throw ArgumentError("refine: the matrix has another shape than the factorization");
  }
  Refinement result;
  const long count = a.rows() * m;
  for (int item = 0; item < batch_; ++item) {
    const double residual = refine_item(a, item, rhs + item * count, x + item * count, m, max_steps,
                                        tolerance, threads, result.steps);
    if (!(residual <= result.residual)) result.residual = residual;
  }
  return result;
}

}  // namespace trajopt::linalg
