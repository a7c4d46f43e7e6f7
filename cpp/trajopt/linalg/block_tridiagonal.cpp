#include "trajopt/linalg/block_tridiagonal.h"

#include <algorithm>
#include <string>

#include "trajopt/base/error.h"
#include "trajopt/base/parallel.h"
#include "trajopt/linalg/block_kernels.h"

namespace trajopt::linalg {

SymmetricBlockTridiagonal::SymmetricBlockTridiagonal(int blocks, int size, int batch)
    : blocks_(blocks), size_(size), batch_(batch) {
  if (blocks < 1 || size < 1 || batch < 0) {
    throw ArgumentError(
        "a block tridiagonal matrix needs at least one block of at least one row: " +
        std::to_string(blocks) + " blocks of size " + std::to_string(size) + ", batch of " +
        std::to_string(batch));
  }
  diagonal_ = BlockBuffer(offset(0, batch, blocks));
  lower_ = BlockBuffer(offset(0, batch, blocks - 1));
}

void SymmetricBlockTridiagonal::set_zero() {
  std::fill_n(diagonal_.data(), diagonal_.size(), 0.0);
  std::fill_n(lower_.data(), lower_.size(), 0.0);
}

void SymmetricBlockTridiagonal::subtract_product(int item, const double* x, double* y, int m,
                                                 long ldx, long ldy, int threads) const {
  const BlockKernels& kernels = block_kernels(active_isa());
  const int size = size_;
  parallel_for(blocks_, threads, [&](long block, int) {
    const int i = static_cast<int>(block);
    const double* xi = x + i * size * ldx;
    double* yi = y + i * size * ldy;
    if (i > 0) {
      kernels.subtract(size, size, lower(i - 1, item), size, xi - size * ldx, yi, m, ldx, ldy, 0);
    }
    kernels.subtract_symmetric(size, diagonal(i, item), size, xi, yi, m, ldx, ldy);
    if (i + 1 < blocks_) {
      kernels.subtract_transposed(size, size, lower(i, item), size, xi + size * ldx, yi, m, ldx,
                                  ldy, 0);
    }
  });
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
