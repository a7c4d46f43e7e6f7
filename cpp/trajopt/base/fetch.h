// Memory asked for before it is needed, in one direction and without gaps: so a second level
// cache's own prefetcher follows and keeps more requests under way than a core can by itself. Into
// the second level only: the first one is too small to wait in.
//
// Always inlined: a function that only prefetches has no effect in the eyes of GCC, which drops it.
#pragma once

namespace trajopt {

template <class T>
inline __attribute__((always_inline)) void fetch(const T* begin, long count) {
  constexpr long kLine = 64 / static_cast<long>(sizeof(T));
  for (long k = 0; k < count; k += kLine) __builtin_prefetch(begin + k, 0, 2);
}

}  // namespace trajopt
