// The memory blocks live in: numbers from a cache line boundary, with spare lines behind the end so
// that a kernel may load whole vectors at the last element.
#pragma once

#include <algorithm>
#include <cstddef>
#include <initializer_list>
#include <memory>
#include <new>

namespace trajopt::linalg {

// The product of sizes, or the largest number there is when that is too large for a size.
std::size_t size_product(std::initializer_list<long> factors);

// Zeroed memory from a cache line on, from a huge page on if it is large. Throws MemoryError when
// the machine has less available than that. A count of elements, for the message and the check.
void* allocate_zeroed(std::size_t count, std::size_t element, std::size_t& alignment);

class AlignedDelete {
 public:
  explicit AlignedDelete(std::size_t alignment = alignof(double)) : alignment_(alignment) {}
  void operator()(void* p) const { ::operator delete[](p, std::align_val_t{alignment_}); }

 private:
  std::size_t alignment_;
};

template <class T>
class BasicBlockBuffer {
 public:
  BasicBlockBuffer() = default;
  explicit BasicBlockBuffer(std::size_t size) : size_(size) {
    std::size_t alignment = 0;
    T* data = static_cast<T*>(allocate_zeroed(size, sizeof(T), alignment));
    data_ = std::unique_ptr<T[], AlignedDelete>(data, AlignedDelete(alignment));
  }

  T* data() const { return data_.get(); }
  std::size_t size() const { return size_; }

 private:
  std::unique_ptr<T[], AlignedDelete> data_;
  std::size_t size_ = 0;
};

using BlockBuffer = BasicBlockBuffer<double>;

}  // namespace trajopt::linalg
