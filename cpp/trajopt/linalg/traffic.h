// Memory traffic in small portions, between the tiles of an elimination.
#pragma once

#include "trajopt/linalg/block_kernels.h"
#include "trajopt/linalg/simd.h"

namespace trajopt::linalg::inline TRAJOPT_ISA {

template <class T>
TRAJOPT_ALWAYS_INLINE void stream_line(const T* source, T* target) {
#pragma GCC unroll 8
  for (int i = 0; i < kLine<T>; i += kWidth<T>) stream(target + i, load(source + i));
}

template <class T>
inline void stream_lines(const T* source, T* target, long count) {
  for (long k = 0; k < count; k += kLine<T>) stream_line(source + k, target + k);
}

// Functions that only prefetch are always inlined: they have no effect in the eyes of GCC, which
// drops them.

// Of a block up to this size the first level cache has room beside what is being worked on. Of a
// larger one it would not keep the lines until they are used, and processors have few misses of
// that cache under way at once: the tiles would wait behind lines they do not need.
inline constexpr int kNearRows = 16;

TRAJOPT_ALWAYS_INLINE void fetch_lines(const double* p, int count, bool near) {
  if (near) {
    for (int c = 0; c < count; c += kLine<double>) prefetch(p + c);
  } else {
    for (int c = 0; c < count; c += kLine<double>) prefetch_second(p + c);
  }
}

template <class T>
TRAJOPT_ALWAYS_INLINE void fetch_row(const BasicTraffic<T>& t, int r) {
  const bool near = t.size <= kNearRows;
  const long at = static_cast<long>(r) * t.size;
  fetch_lines(t.fetch_lower + at, r + 1, near);
  if (t.fetch_whole) fetch_lines(t.fetch_whole + at, t.size, near);
  // Reading claims as well as a prefetch for writing where no other core has the line, and waits
  // for less.
  const long end = t.claim_length * (r + 1L) / t.size;
  for (long i = t.claim_length * r / t.size; i < end; i += kLine<T>) prefetch_second(t.claim + i);
}

template <class T>
inline void write_row(const BasicTraffic<T>& t, int r) {
  const long lines = PackedTriangle<T>::length(t.size) / kLine<T>;
  const long begin = lines * r / t.size * kLine<T>, end = lines * (r + 1L) / t.size * kLine<T>;
  stream_lines(t.w + begin, t.w_target + begin, end - begin);
  for (int i = 0; i < 2; ++i) {
    if (!t.v[i]) continue;
    for (int c = 0; c < t.size; c += kLine<T>) {
      stream_line(t.v[i] + r * t.ld + c, t.target[i] + r * t.target_ld + c);
    }
  }
}

template <class T>
inline void move(BasicTraffic<T>& t, int rows) {
  for (int i = 0; i < rows && t.fetch_rows > 0; ++i) fetch_row(t, --t.fetch_rows);
  for (int i = 0; i < rows && t.write_rows > 0; ++i) write_row(t, --t.write_rows);
}

}  // namespace trajopt::linalg::inline TRAJOPT_ISA
