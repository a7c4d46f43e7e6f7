// A symmetric block tridiagonal matrix, or a batch, in device memory; the layout of
// linalg::SymmetricBlockTridiagonal.
#pragma once

#include "trajopt/cuda/base/buffer.h"
#include "trajopt/linalg/block_tridiagonal.h"

namespace trajopt::cuda {

class BlockTridiagonal {
 public:
  BlockTridiagonal() = default;
  BlockTridiagonal(int blocks, int size, int batch = 1);

  int blocks() const { return blocks_; }
  int size() const { return size_; }
  int batch() const { return batch_; }
  long rows() const { return static_cast<long>(blocks_) * size_; }  // of one matrix

  double* diagonal() const { return diagonal_.data(); }  // (batch, blocks, size, size)
  double* lower() const { return lower_.data(); }        // (batch, blocks - 1, size, size)

  // Copies a matrix of the same shape, ordered in the stream.
  void upload(const linalg::SymmetricBlockTridiagonal& a, const Stream& stream);

 private:
  int blocks_ = 0, size_ = 0, batch_ = 0;
  DeviceBuffer<double> diagonal_, lower_;
};

}  // namespace trajopt::cuda
