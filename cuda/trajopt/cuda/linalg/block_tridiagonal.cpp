#include "trajopt/cuda/linalg/block_tridiagonal.h"

#include <string>

namespace trajopt::cuda {

BlockTridiagonal::BlockTridiagonal(int blocks, int size, int batch)
    : blocks_(blocks), size_(size), batch_(batch) {
  if (blocks < 1 || size < 1 || batch < 0) {
    throw ArgumentError(
        "a block tridiagonal matrix needs at least one block of at least one row: " +
        std::to_string(blocks) + " blocks of size " + std::to_string(size) + ", batch of " +
        std::to_string(batch));
  }
  const std::size_t block = static_cast<std::size_t>(size) * size;
  diagonal_ = DeviceBuffer<double>(block * blocks * batch);
  lower_ = DeviceBuffer<double>(block * (blocks - 1) * batch);
}

void BlockTridiagonal::upload(const linalg::SymmetricBlockTridiagonal& a, const Stream& stream) {
  if (a.blocks() != blocks_ || a.size() != size_ || a.batch() != batch_) {
    throw ArgumentError("upload: the matrix has another shape than its place on the device");
  }
  diagonal_.upload(a.diagonal(0), diagonal_.size(), stream);
  if (lower_.size() > 0) lower_.upload(a.lower(0), lower_.size(), stream);
}

}  // namespace trajopt::cuda
