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

// Always inlined: a function that only prefetches has no effect in the eyes of GCC, which drops it.
template <class T>
TRAJOPT_ALWAYS_INLINE void fetch_row(const BasicTraffic<T>& t, int r) {
  const double* lower = t.fetch_lower + static_cast<long>(r) * t.size;
  for (int c = 0; c <= r; c += kLine<double>) prefetch(lower + c);
  if (t.fetch_whole) {
    const double* whole = t.fetch_whole + static_cast<long>(r) * t.size;
    for (int c = 0; c < t.size; c += kLine<double>) prefetch(whole + c);
  }
  const long end = t.claim_length * (r + 1L) / t.size;
  for (long i = t.claim_length * r / t.size; i < end; i += kLine<T>) {
    __builtin_prefetch(t.claim + i, 1, 3);
  }
}

template <class T>
inline void write_row(const BasicTraffic<T>& t, int r) {
  const T* w = t.w + r * t.ld;
  T* packed = t.packed + r * static_cast<long>(kLine<T>);
  for (int c = 0; c <= r; c += kLine<T>) {
    stream_line(w + c, packed);
    packed += kLine<T> * (t.size - c - static_cast<long>(kLine<T>));  // the next panel's row
  }
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
