// A fixed-size array of doubles on a cache line boundary, with one spare vector behind the end so
// that a kernel may load a whole vector at the last element.
#pragma once

#include <algorithm>
#include <cstddef>
#include <memory>
#include <new>

namespace trajopt::linalg {

class AlignedBuffer {
 public:
  static constexpr std::size_t kAlignment = 64;
  static constexpr std::size_t kSpare = 8;

  AlignedBuffer() = default;
  explicit AlignedBuffer(std::size_t size) : size_(size) {
    const std::size_t bytes = (size + kSpare) * sizeof(double);
    data_.reset(static_cast<double*>(::operator new[](bytes, std::align_val_t{kAlignment})));
    std::fill_n(data_.get(), size + kSpare, 0.0);
  }

  double* data() const { return data_.get(); }
  std::size_t size() const { return size_; }

 private:
  struct Deleter {
    void operator()(double* p) const { ::operator delete[](p, std::align_val_t{kAlignment}); }
  };
  std::unique_ptr<double[], Deleter> data_;
  std::size_t size_ = 0;
};

}  // namespace trajopt::linalg
