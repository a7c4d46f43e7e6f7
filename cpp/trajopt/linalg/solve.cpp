// Solution with the factors, and iterative refinement.
#include <algorithm>
#include <bit>
#include <cstdint>

#include "trajopt/base/error.h"
#include "trajopt/base/parallel.h"
#include "trajopt/linalg/column_scale.h"
#include "trajopt/linalg/factorization.h"

namespace trajopt::linalg {

double largest_magnitude(const double* x, long rows, int columns, long ld) {
  // As integers, magnitudes are ordered like the numbers, and a NaN is above them all.
  constexpr int kChains = 4;
  std::uint64_t most[kChains] = {};
  const auto fold = [](std::uint64_t& a, double value) {
    const std::uint64_t b = std::bit_cast<std::uint64_t>(value) << 1;
    a = a < b ? b : a;
  };
  const bool dense = ld == columns;
  const long lines = dense ? 1 : rows, count = dense ? rows * columns : columns;
  for (long i = 0; i < lines; ++i) {
    const double* line = x + i * ld;
    long j = 0;
    for (; j + kChains <= count; j += kChains) {
      for (int k = 0; k < kChains; ++k) fold(most[k], line[j + k]);
    }
    for (; j < count; ++j) fold(most[0], line[j]);
  }
  return std::bit_cast<double>(*std::max_element(most, most + kChains) >> 1);
}

// A few columns at a time are rounded, solved for and written back. Powers of two bring each column
// to the middle of float32's range: corrections of a refinement would leave it otherwise.
void Factorization::solve_in_single(int item, double* rhs, int m, int threads) const {
  const long rows = static_cast<long>(blocks_) * size_;
  float* x = columns_.data() + item * rows * kColumnsAtOnce;
  for (int c = 0; c < m; c += kColumnsAtOnce) {
    const int columns = std::min(kColumnsAtOnce, m - c);
    double scale[kColumnsAtOnce];
    for (int j = 0; j < columns; ++j) {
      scale[j] = column_scale(largest_magnitude(rhs + c + j, rows, 1, m));
      for (long i = 0; i < rows; ++i) {
        x[i * columns + j] = static_cast<float>(rhs[i * m + c + j] / scale[j]);
      }
    }
    single_->solve(item, x, columns, threads);
    for (long i = 0; i < rows; ++i) {
      for (int j = 0; j < columns; ++j) {
        rhs[i * m + c + j] = x[i * columns + j] * scale[j];
      }
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
  double* r = residual_.data();
  double* saved = saved_.data();
  double* room = magnitudes_.data();
  Refinement worst;
  for (int c = 0; c < m; c += kColumnsAtOnce) {
    const int columns = std::min(kColumnsAtOnce, m - c);
    // body(in r, in x) for every element, shared among the threads by blocks
    const auto each = [&](const auto& body) {
      parallel_for(blocks_, threads, [&](long block, int) {
        for (long i = block * size_; i < (block + 1) * size_; ++i) {
          for (int j = 0; j < columns; ++j) body(i * columns + j, i * m + c + j);
        }
      });
    };
    parallel_for(blocks_, threads, [&](long i, int) {
      room[i] = largest_magnitude(rhs + i * size_ * m + c, size_, columns, m);
    });
    const double size = largest_magnitude(room, blocks_, 1, 1);
    const double scale = size > 0.0 ? size : 1.0;
    const auto evaluate = [&] {
      return a.residual(item, rhs + c, x + c, r, columns, m, room, threads) / scale;
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
