// Memory aligned for any SIMD pack.
#pragma once

#include <cstddef>
#include <memory>
#include <new>

namespace trajopt {

inline constexpr std::size_t kAlignment = 64;

struct AlignedDelete {
  void operator()(std::byte* p) const { ::operator delete[](p, std::align_val_t{kAlignment}); }
};
using AlignedBuffer = std::unique_ptr<std::byte[], AlignedDelete>;

inline AlignedBuffer aligned_buffer(std::size_t bytes) {
  return AlignedBuffer(
      static_cast<std::byte*>(::operator new[](bytes, std::align_val_t{kAlignment})));
}

}  // namespace trajopt
