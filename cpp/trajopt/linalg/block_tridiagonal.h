// Storage of a symmetric block tridiagonal matrix, or of a batch of them:
//
//   D0  L0t            diagonal(i): size x size, row-major, only the lower triangle is read
//   L0  D1  L1t        lower(i) = A[i+1, i]: size x size, row-major
//       L1  D2  ...
#pragma once

#include <cstddef>

#include "trajopt/linalg/block_buffer.h"

namespace trajopt::linalg {

class SymmetricBlockTridiagonal {
 public:
  SymmetricBlockTridiagonal() = default;
  SymmetricBlockTridiagonal(int blocks, int size, int batch = 1);

  int blocks() const { return blocks_; }
  int size() const { return size_; }
  int batch() const { return batch_; }
  long rows() const { return static_cast<long>(blocks_) * size_; }  // of one matrix

  double* diagonal(int i, int item = 0) { return diagonal_.data() + offset(i, item, blocks_); }
  double* lower(int i, int item = 0) { return lower_.data() + offset(i, item, blocks_ - 1); }
  const double* diagonal(int i, int item = 0) const {
    return diagonal_.data() + offset(i, item, blocks_);
  }
  const double* lower(int i, int item = 0) const {
    return lower_.data() + offset(i, item, blocks_ - 1);
  }

  void set_zero();

  // y = A x for x, y of shape (batch, rows, m), row-major. Same bits for every thread count.
  void matmul(const double* x, double* y, int m, int threads = 1) const;

  // y -= A x for columns of matrices with leading dimensions ldx, ldy and one problem.
  void subtract_product(int item, const double* x, double* y, int m, long ldx, long ldy,
                        int threads) const;

  // r = rhs - A x for columns of one problem; returns the largest magnitude in r, NaN if there is
  // one. rhs and x have leading dimension ld, r has none to spare; room: `blocks` numbers.
  double residual(int item, const double* rhs, const double* x, double* r, int columns, long ld,
                  double* room, int threads) const;

 private:
  void subtract_block(int item, int i, const double* x, double* y, int m, long ldx, long ldy) const;
  std::size_t offset(int i, int item, int per_item) const {
    return (static_cast<std::size_t>(item) * per_item + i) * size_ * size_;
  }
  int blocks_ = 0, size_ = 0, batch_ = 0;
  BlockBuffer diagonal_, lower_;
};

}  // namespace trajopt::linalg
