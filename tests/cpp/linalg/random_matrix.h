// Random systems for the linear algebra tests, and a dense solver that shares nothing with them.
#pragma once

#include <cmath>
#include <random>
#include <utility>
#include <vector>

#include "trajopt/linalg/block_tridiagonal.h"

namespace trajopt::test {

using linalg::SymmetricBlockTridiagonal;

inline std::vector<double> random_vector(std::size_t count, unsigned seed) {
  std::mt19937_64 generator(seed);
  std::normal_distribution<double> normal;
  std::vector<double> x(count);
  for (double& value : x) value = normal(generator);
  return x;
}

// Row r of each block gets the sign -1 when r % 3 == 2, as multipliers among variables.
inline std::vector<signed char> mixed_signs(long rows, int size) {
  std::vector<signed char> signs(rows, 1);
  for (long i = 0; i < rows; ++i) {
    if (i % size % 3 == 2) signs[i] = -1;
  }
  return signs;
}

// Diagonally dominant with the given signs (nullptr: positive definite). The strict upper triangle
// of the diagonal blocks is filled with NaN, which nobody may read.
inline void fill_random(SymmetricBlockTridiagonal& a, const signed char* signs, unsigned seed) {
  std::mt19937_64 generator(seed);
  std::normal_distribution<double> normal;
  const int size = a.size();
  for (int item = 0; item < a.batch(); ++item) {
    for (int i = 0; i < a.blocks(); ++i) {
      for (int r = 0; r < size; ++r) {
        double* row = a.diagonal(i, item) + static_cast<long>(r) * size;
        for (int s = 0; s < r; ++s) row[s] = normal(generator);
        for (int s = r + 1; s < size; ++s) row[s] = std::nan("");
        row[r] = 2.5 * size + 2.0 + normal(generator) * 0.1;
        if (signs && signs[static_cast<long>(i) * size + r] < 0) row[r] = -row[r];
      }
      for (long k = 0; i + 1 < a.blocks() && k < static_cast<long>(size) * size; ++k) {
        a.lower(i, item)[k] = normal(generator);
      }
    }
  }
}

inline std::vector<double> dense(const SymmetricBlockTridiagonal& a, int item = 0) {
  const long rows = a.rows();
  const int size = a.size();
  std::vector<double> full(rows * rows, 0.0);
  const auto set = [&](long i, long j, double value) {
    full[i * rows + j] = full[j * rows + i] = value;
  };
  for (int b = 0; b < a.blocks(); ++b) {
    const long at = static_cast<long>(b) * size;
    for (int r = 0; r < size; ++r) {
      for (int s = 0; s <= r; ++s) set(at + r, at + s, a.diagonal(b, item)[r * size + s]);
      for (int s = 0; b + 1 < a.blocks() && s < size; ++s) {
        set(at + size + r, at + s, a.lower(b, item)[r * size + s]);
      }
    }
  }
  return full;
}

// Gaussian elimination with partial pivoting in extended precision; one right-hand side.
inline std::vector<double> dense_solve(const std::vector<double>& a, const std::vector<double>& b) {
  const std::size_t n = b.size();
  std::vector<long double> m(a.begin(), a.end()), x(b.begin(), b.end());
  for (std::size_t k = 0; k < n; ++k) {
    std::size_t best = k;
    for (std::size_t i = k + 1; i < n; ++i) {
      if (std::abs(m[i * n + k]) > std::abs(m[best * n + k])) best = i;
    }
    for (std::size_t j = 0; j < n && best != k; ++j) std::swap(m[k * n + j], m[best * n + j]);
    std::swap(x[k], x[best]);
    for (std::size_t i = k + 1; i < n; ++i) {
      const long double factor = m[i * n + k] / m[k * n + k];
      if (factor == 0.0L) continue;
      for (std::size_t j = k; j < n; ++j) m[i * n + j] -= factor * m[k * n + j];
      x[i] -= factor * x[k];
    }
  }
  for (std::size_t k = n; k-- > 0;) {
    for (std::size_t j = k + 1; j < n; ++j) x[k] -= m[k * n + j] * x[j];
    x[k] /= m[k * n + k];
  }
  return {x.begin(), x.end()};
}

inline double relative_error(const std::vector<double>& x, const std::vector<double>& expected) {
  double error = 0.0, scale = 1e-300;
  for (std::size_t i = 0; i < x.size(); ++i) {
    error = std::max(error, std::abs(x[i] - expected[i]));
    scale = std::max(scale, std::abs(expected[i]));
    if (std::isnan(x[i])) return INFINITY;
  }
  return error / scale;
}

}  // namespace trajopt::test
