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

// A few columns at a time are rounded, solved for and written back.
void Factorization::solve_in_single(int item, double* rhs, int m, int threads) const {
  const long rows = static_cast<long>(blocks_) * size_;
  float* x = columns_.data() + item * rows * kColumnsAtOnce;
  for (int c = 0; c < m; c += kColumnsAtOnce) {
    const int columns = std::min(kColumnsAtOnce, m - c);
    for (long i = 0; i < rows; ++i) {
      for (int j = 0; j < columns; ++j) x[i * columns + j] = static_cast<float>(rhs[i * m + c + j]);
    }
    single_->solve(item, x, columns, threads);
    for (long i = 0; i < rows; ++i) {
      for (int j = 0; j < columns; ++j) rhs[i * m + c + j] = x[i * columns + j];
    }
  }
}

void Factorization::solve_item(int item, double* x, int m, int threads) const {
  if (!factored_) throw ArgumentError("solve: there is no factorization, factor() has to succeed");
  if (m < 1) return;
  if (double_) {
    double_->solve(item, x, m, threads);
  } else {
    solve_in_single(item, x, m, threads);
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
  for (int c = 0; c < m; c += kColumnsAtOnce) {
    const int columns = std::min(kColumnsAtOnce, m - c);
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
