// The systems that the linear algebra is measured on, and a random one of a given shape.
#pragma once

#include <cmath>
#include <random>
#include <vector>

#include "trajopt/linalg/block_tridiagonal.h"

namespace trajopt::bench {

struct Shape {
  int blocks, size, batch;
};

// Single trajectories: the sizes of bench/linalg_bench.cpp, then long ones (blocks of two frames
// with 18 unknowns); batches: one-second problems.
inline std::vector<Shape> shapes() {
  std::vector<Shape> all = {{20, 96, 1},   {80, 72, 1},   {20, 176, 1},  {512, 64, 1},
                            {2048, 32, 1}, {8192, 16, 1}, {200, 48, 1},  {400, 40, 1},
                            {200, 82, 1},  {200, 36, 1},  {2000, 36, 1}, {50000, 36, 1}};
  for (int batch : {1, 8, 64, 512, 1024, 4096, 8192}) all.push_back({20, 36, batch});
  for (int batch : {1, 64, 1024}) all.push_back({20, 72, batch});
  return all;
}

// Diagonally dominant, with the signs of a KKT matrix where `signs` is given.
inline void fill(linalg::SymmetricBlockTridiagonal& a, std::vector<signed char>* signs) {
  std::minstd_rand generator(1);
  const auto next = [&] { return 2.0 * generator() / generator.max() - 1.0; };
  const int n = a.size();
  if (signs) signs->assign(a.batch() * a.rows(), 1);
  for (int item = 0; item < a.batch(); ++item) {
    for (int i = 0; i < a.blocks(); ++i) {
      for (int k = 0; k < n * n; ++k) a.diagonal(i, item)[k] = next();
      for (int r = 0; r < n; ++r) {
        const bool negative = signs && r % 3 == 2;
        a.diagonal(i, item)[r * (n + 1)] = (negative ? -1.0 : 1.0) * (1.5 * n + 2.0);
        if (negative) (*signs)[item * a.rows() + static_cast<long>(i) * n + r] = -1;
      }
      for (int k = 0; i + 1 < a.blocks() && k < n * n; ++k) a.lower(i, item)[k] = next();
    }
  }
}

inline std::vector<double> ramp(std::size_t count) {
  std::vector<double> x(count);
  for (std::size_t i = 0; i < count; ++i) x[i] = std::sin(0.1 * static_cast<double>(i % 9973));
  return x;
}

}  // namespace trajopt::bench
