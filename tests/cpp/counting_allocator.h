// Replaces the program's operator new by one that counts. To be included once in a program.
#pragma once

#include <atomic>
#include <cstdlib>
#include <new>

namespace trajopt::test {
inline std::atomic<long> allocations{0};
}

// Not inlined: GCC would take free() for a mismatch with operator new.
[[gnu::noinline]] void* operator new(std::size_t bytes) {
  ++trajopt::test::allocations;
  if (void* p = std::malloc(bytes ? bytes : 1)) return p;
  throw std::bad_alloc();
}
[[gnu::noinline]] void* operator new(std::size_t bytes, std::align_val_t alignment) {
  ++trajopt::test::allocations;
  const std::size_t step = static_cast<std::size_t>(alignment);
  if (void* p = std::aligned_alloc(step, (bytes + step - 1) / step * step)) return p;
  throw std::bad_alloc();
}
[[gnu::noinline]] void operator delete(void* p) noexcept { std::free(p); }
[[gnu::noinline]] void operator delete(void* p, std::size_t) noexcept { std::free(p); }
[[gnu::noinline]] void operator delete(void* p, std::align_val_t) noexcept { std::free(p); }
[[gnu::noinline]] void operator delete(void* p, std::size_t, std::align_val_t) noexcept {
  std::free(p);
}
