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

// Takes one row's share off the end of a piece: how many elements, from `left` on.
template <class T>
TRAJOPT_ALWAYS_INLINE long take(BasicPiece<T>& piece) {
  const long count = piece.per_row < piece.left ? piece.per_row : piece.left;
  piece.left -= count;
  return count;
}

template <class T>
TRAJOPT_ALWAYS_INLINE void fetch_row(BasicTraffic<T>& t, int r) {
  const bool near = t.size <= kNearRows;
  const long at = static_cast<long>(r) * t.size;
  fetch_lines(t.fetch_lower + at, r + 1, near);
  if (t.fetch_whole) fetch_lines(t.fetch_whole + at, t.size, near);
  // Reading claims as well as a prefetch for writing where no other core has the line, and waits
  // for less.
  const long count = take(t.claim);
  for (long i = 0; i < count; i += kLine<T>) prefetch_second(t.claim.data + t.claim.left + i);
}

template <class T>
inline void write_row(BasicTraffic<T>& t, int r) {
  const long count = take(t.w_target), at = t.w_target.left;
  stream_lines(t.w + at, t.w_target.data + at, count);
  const long from = r * t.ld, to = r * t.target_ld;
  const int columns = t.size;
  for (int i = 0; i < 2; ++i) {
    const T* v = t.v[i];
    T* target = t.target[i];
    if (!v) continue;
    for (int c = 0; c < columns; c += kLine<T>) stream_line(v + from + c, target + to + c);
  }
}

template <class T>
inline void move(BasicTraffic<T>& t, int rows) {
  for (int i = 0; i < rows && t.fetch_rows > 0; ++i) {
    --t.fetch_rows;
    fetch_row(t, t.fetch_upwards ? t.size - 1 - t.fetch_rows : t.fetch_rows);
  }
  for (int i = 0; i < rows && t.write_rows > 0; ++i) write_row(t, --t.write_rows);
}

}  // namespace trajopt::linalg::inline TRAJOPT_ISA
