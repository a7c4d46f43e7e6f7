#include "trajopt/cuda/base/buffer.h"

#include <limits>
#include <string>

namespace trajopt::cuda::detail {

namespace {

std::size_t total_bytes(std::size_t count, std::size_t element) {
  if (count > std::numeric_limits<std::size_t>::max() / element) {
    throw DeviceError("cannot allocate " + std::to_string(count) + " elements of " +
                      std::to_string(element) + " bytes: more than the address space holds");
  }
  return count * element;
}

}  // namespace

void* allocate_device(std::size_t count, std::size_t element) {
  const std::size_t bytes = total_bytes(count, element);
  void* p = nullptr;
  if (bytes > 0) check_allocation(cudaMalloc(&p, bytes), "cudaMalloc", bytes);
  return p;
}

void* allocate_pinned(std::size_t count, std::size_t element) {
  const std::size_t bytes = total_bytes(count, element);
  void* p = nullptr;
  if (bytes > 0) check_allocation(cudaMallocHost(&p, bytes), "cudaMallocHost", bytes);
  return p;
}

}  // namespace trajopt::cuda::detail
