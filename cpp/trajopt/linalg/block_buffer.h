// The memory blocks live in: doubles from a cache line boundary, with one spare vector behind the
// end so that a kernel may load a whole vector at the last element.
#pragma once

#include <algorithm>
#include <cstddef>
#include <memory>
#include <new>

#ifdef __linux__
#include <sys/mman.h>
#endif

namespace trajopt::linalg {

class AlignedDelete {
 public:
  explicit AlignedDelete(std::size_t alignment = alignof(double)) : alignment_(alignment) {}
  void operator()(double* p) const { ::operator delete[](p, std::align_val_t{alignment_}); }

 private:
  std::size_t alignment_;
};

class BlockBuffer {
 public:
  BlockBuffer() = default;
  explicit BlockBuffer(std::size_t size) : size_(size) {
    const std::size_t bytes = (size + kSpare) * sizeof(double);
    const std::size_t alignment = bytes >= kHugePage ? kHugePage : kCacheLine;
    data_ = std::unique_ptr<double[], AlignedDelete>(
        static_cast<double*>(::operator new[](bytes, std::align_val_t{alignment})),
        AlignedDelete(alignment));
#if defined(__linux__) && defined(MADV_HUGEPAGE)
    // A sweep touches each page once: with small pages address translation costs more than the
    // arithmetic. Only a request; nothing depends on the answer.
    if (bytes >= kHugePage) madvise(data_.get(), bytes / kHugePage * kHugePage, MADV_HUGEPAGE);
#endif
    std::fill_n(data_.get(), size + kSpare, 0.0);
  }

  double* data() const { return data_.get(); }
  std::size_t size() const { return size_; }

 private:
  static constexpr std::size_t kCacheLine = 64;
  static constexpr std::size_t kHugePage = std::size_t{1} << 21;
  static constexpr std::size_t kSpare = 8;

  std::unique_ptr<double[], AlignedDelete> data_;
  std::size_t size_ = 0;
};

}  // namespace trajopt::linalg
