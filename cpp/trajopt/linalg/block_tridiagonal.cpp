#include "trajopt/linalg/block_tridiagonal.h"

#include <algorithm>
#include <string>

#include "trajopt/base/error.h"
#include "trajopt/base/parallel.h"
#include "trajopt/linalg/block_kernels.h"
#include "trajopt/linalg/refinement.h"

namespace trajopt::linalg {

SymmetricBlockTridiagonal::SymmetricBlockTridiagonal(int blocks, int size, int batch)
    : blocks_(blocks), size_(size), batch_(batch) {
  if (blocks < 1 || size < 1 || batch < 0) {
    throw ArgumentError(
        "a block tridiagonal matrix needs at least one block of at least one row: " +
        std::to_string(blocks) + " blocks of size " + std::to_string(size) + ", batch of " +
        std::to_string(batch));
  }
  diagonal_ = BlockBuffer(size_product({batch, blocks, size, size}));
  lower_ = BlockBuffer(size_product({batch, blocks - 1, size, size}));
}

void SymmetricBlockTridiagonal::set_zero() {
  std::fill_n(diagonal_.data(), diagonal_.size(), 0.0);
  std::fill_n(lower_.data(), lower_.size(), 0.0);
}

// Rows of block i of y -= A x.
void SymmetricBlockTridiagonal::subtract_block(int item, int i, const double* x, double* y, int m,
                                               long ldx, long ldy) const {
  const BlockKernels& kernels = block_kernels(active_isa());
  // Asked for ahead: the same place in a later block, so that of triangles only triangles are read.
  constexpr long kAhead = 16384 / sizeof(double);
  const long square = static_cast<long>(size_) * size_;
  const long ahead = (kAhead + square - 1) / square * square;
  const int size = size_;
  const double* xi = x + static_cast<long>(i) * size * ldx;
  double* yi = y + static_cast<long>(i) * size * ldy;
  if (i > 0) {
    kernels.subtract(size, size, lower(i - 1, item), size, xi - size * ldx, yi, m, ldx, ldy,
                     ahead + square);
  }
  kernels.subtract_symmetric(size, diagonal(i, item), size, xi, yi, m, ldx, ldy, ahead);
  if (i + 1 < blocks_) {
    kernels.subtract_transposed(size, size, lower(i, item), size, xi + size * ldx, yi, m, ldx, ldy,
                                0);
  }
}

void SymmetricBlockTridiagonal::subtract_product(int item, const double* x, double* y, int m,
                                                 long ldx, long ldy, int threads) const {
  parallel_for(blocks_, threads,
               [&](long i, int) { subtract_block(item, static_cast<int>(i), x, y, m, ldx, ldy); });
}

double SymmetricBlockTridiagonal::residual(int item, const double* rhs, const double* x, double* r,
                                           int columns, long ld, double* room, int threads) const {
  parallel_for(blocks_, threads, [&](long i, int) {
    double* ri = r + i * size_ * columns;
    const double* bi = rhs + i * size_ * ld;
    if (ld == columns) {
      std::copy_n(bi, size_ * ld, ri);
    } else {
      for (int k = 0; k < size_; ++k) std::copy_n(bi + k * ld, columns, ri + k * columns);
    }
    subtract_block(item, static_cast<int>(i), x, r, columns, ld, columns);
    room[i] = largest_magnitude(ri, size_, columns, columns);
  });
  return largest_magnitude(room, blocks_, 1, 1);
}

void SymmetricBlockTridiagonal::matmul(const double* x, double* y, int m, int threads) const {
  const long count = rows() * m;
  std::fill_n(y, batch_ * count, 0.0);
  const bool over_items = batch_ > 1;
  parallel_for(batch_, over_items ? threads : 1, [&](long item, int) {
    double* yi = y + item * count;
    subtract_product(static_cast<int>(item), x + item * count, yi, m, m, m,
                     over_items ? 1 : threads);
    for (long j = 0; j < count; ++j) yi[j] = -yi[j];
  });
}

}  // namespace trajopt::linalg
