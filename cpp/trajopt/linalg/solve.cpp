// Solution with the factors, and iterative refinement.
#include <algorithm>
#include <cmath>

#include "trajopt/base/error.h"
#include "trajopt/base/parallel.h"
#include "trajopt/linalg/factorization.h"

namespace trajopt::linalg {

double largest_magnitude(const double* x, long rows, int columns, long ld) {
  double most = 0.0;
  for (long i = 0; i < rows; ++i) {
    for (int j = 0; j < columns; ++j) {
      const double value = std::abs(x[i * ld + j]);
      if (std::isnan(value)) return value;
      most = std::max(most, value);
    }
  }
  return most;
}

// Eliminates a block's unknowns from the equations after it. The update of a deferred left
// neighbour is the caller's.
void Factorization::forward(int item, const Step& step, double* x, int m) const {
  double* xi = x + static_cast<long>(step.block) * size_ * m;
  kernels_->substitute_transposed(size_, w(item, step.block), ld_, xi, m, m);
  if (step.right >= 0) {
    kernels_->subtract_transposed(size_, size_, coupling(item, right_slot_[step.block]), ld_, xi,
                                  x + static_cast<long>(step.right) * size_ * m, m, m, m);
  }
  if (step.left >= 0 && !step.left_deferred) {
    kernels_->subtract_transposed(size_, size_, coupling(item, left_slot_[step.block]), ld_, xi,
                                  x + static_cast<long>(step.left) * size_ * m, m, m, m);
  }
}

void Factorization::backward(int item, const Step& step, double* x, int m) const {
  double* xi = x + static_cast<long>(step.block) * size_ * m;
  const double* inverse =
      inverse_.data() + (static_cast<long>(item) * blocks_ + step.block) * size_;
  for (int k = 0; k < size_; ++k) {
    for (int j = 0; j < m; ++j) xi[static_cast<long>(k) * m + j] *= inverse[k];
  }
  if (step.left >= 0) {
    kernels_->subtract(size_, size_, coupling(item, left_slot_[step.block]), ld_,
                       x + static_cast<long>(step.left) * size_ * m, xi, m, m, m);
  }
  if (step.right >= 0) {
    kernels_->subtract(size_, size_, coupling(item, right_slot_[step.block]), ld_,
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
      kernels_->subtract_transposed(size_, size_, coupling(item, left_slot_[step.block]), ld_,
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
  threads = useful_threads(threads);
  if (batch_ == 1) return solve_item(0, rhs, m, threads);
  if (!factored_) throw ArgumentError("solve: there is no factorization, factor() has to succeed");
  parallel_for(batch_, threads, [&](long item, int) {
    solve_item(static_cast<int>(item), rhs + item * count, m, 1);
  });
}

Refinement Factorization::refine_item(const SymmetricBlockTridiagonal& a, int item,
                                      const double* rhs, double* x, int m, int max_steps,
                                      double tolerance, int threads) {
  const long rows = a.rows();
  double* r = residual_.data();
  double* saved = saved_.data();
  Refinement worst;
  for (int c = 0; c < m; c += kRefineColumns) {
    const int columns = std::min(kRefineColumns, m - c);
    const double size = largest_magnitude(rhs + c, rows, columns, m);
    const double scale = size > 0.0 ? size : 1.0;
    const auto each = [&](const auto& body) {
      for (long i = 0; i < rows; ++i) {
        for (int j = 0; j < columns; ++j) body(i * columns + j, i * m + c + j);
      }
    };
    const auto evaluate = [&] {
      each([&](long local, long global) { r[local] = rhs[global]; });
      a.subtract_product(item, x + c, r, columns, m, columns, threads);
      return largest_magnitude(r, rows, columns, columns) / scale;
    };
    const auto correct = [&] {
      solve_item(item, r, columns, threads);
      each([&](long local, long global) {
        saved[local] = x[global];
        x[global] += r[local];
      });
    };
    const auto undo = [&] { each([&](long local, long global) { x[global] = saved[local]; }); };
    const Refinement result = refine_loop(max_steps, tolerance, evaluate, correct, undo);
    worst.steps = std::max(worst.steps, result.steps);
    if (!(result.residual <= worst.residual)) worst.residual = result.residual;
  }
  return worst;
}

Refinement Factorization::refine(const SymmetricBlockTridiagonal& a, const double* rhs, double* x,
                                 int m, int max_steps, double tolerance, int threads) {
  if (a.blocks() != blocks_ || a.size() != size_ || a.batch() != batch_) {
    throw ArgumentError("refine: the matrix has another shape than the factorization");
  }
  threads = useful_threads(threads);
  Refinement worst;
  const long count = a.rows() * m;
  for (int item = 0; item < batch_; ++item) {
    const Refinement result = refine_item(a, item, rhs + item * count, x + item * count, m,
                                          max_steps, tolerance, threads);
    worst.steps = std::max(worst.steps, result.steps);
    if (!(result.residual <= worst.residual)) worst.residual = result.residual;
  }
  return worst;
}

}  // namespace trajopt::linalg
