#include "trajopt/linalg/block_buffer.h"

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <limits>

#include "trajopt/base/error.h"

#ifdef __linux__
#include <sys/mman.h>
#endif

namespace trajopt::linalg {

namespace {

constexpr std::size_t kCacheLine = 64;
constexpr std::size_t kHugePage = std::size_t{1} << 21;
constexpr std::size_t kSpare = 16 * kCacheLine;  // a square of the widest vectors
constexpr std::size_t kMost = std::numeric_limits<std::size_t>::max();

// Linux promises memory it does not have and ends the process that comes to use it. So large
// requests are compared with what there is first.
std::size_t available_memory() {
#ifdef __linux__
  if (std::FILE* file = std::fopen("/proc/meminfo", "r")) {
    char line[128];
    unsigned long long kilobytes = 0;
    bool found = false;
    while (!found && std::fgets(line, sizeof line, file)) {
      found = std::sscanf(line, "MemAvailable: %llu kB", &kilobytes) == 1;
    }
    std::fclose(file);
    if (found) return static_cast<std::size_t>(kilobytes) * 1024;
  }
#endif
  return kMost;
}

[[noreturn]] void fail(std::size_t count, std::size_t element) {
  char text[160];
  std::snprintf(
      text, sizeof text,
      "out of memory: %.3g GiB asked for in one piece, the machine has %.3g GiB available",
      static_cast<double>(count) * static_cast<double>(element) / (1u << 30),
      static_cast<double>(available_memory()) / (1u << 30));
  throw MemoryError(text);
}

}  // namespace

std::size_t size_product(std::initializer_list<long> factors) {
  std::size_t product = 1;
  for (const long factor : factors) {
    const std::size_t f = static_cast<std::size_t>(factor);
    if (f != 0 && product > kMost / f) return kMost;
    product *= f;
  }
  return product;
}

void* allocate_zeroed(std::size_t count, std::size_t element, std::size_t& alignment) {
  if (count > (kMost / 2 - kSpare) / element) fail(count, element);
  std::size_t bytes = count * element + kSpare;
  constexpr std::size_t kLarge = std::size_t{1} << 26;
  if (bytes > kLarge && bytes > available_memory()) fail(count, element);
  // Half a huge page and more becomes a whole one.
  bytes = std::max(bytes, (bytes + kHugePage / 2) / kHugePage * kHugePage);
  alignment = bytes >= kHugePage ? kHugePage : kCacheLine;
  void* data = ::operator new[](bytes, std::align_val_t{alignment}, std::nothrow);
  if (!data) fail(count, element);
#if defined(__linux__) && defined(MADV_HUGEPAGE)
  // A sweep touches each page once: with small pages address translation costs more than the
  // arithmetic. Only a request; nothing depends on the answer.
  if (bytes >= kHugePage) madvise(data, bytes / kHugePage * kHugePage, MADV_HUGEPAGE);
#endif
  std::memset(data, 0, bytes);
  return data;
}

}  // namespace trajopt::linalg
