// Four doubles or eight floats; included by simd.h.
#pragma once

#include <immintrin.h>

#include "trajopt/base/hd.h"

#define TRAJOPT_ALWAYS_INLINE inline __attribute__((always_inline))

namespace trajopt::linalg::inline TRAJOPT_ISA {

template <class T>
struct VectorOf;
template <>
struct VectorOf<double> {
  using Type = __m256d;
};
template <>
struct VectorOf<float> {
  using Type = __m256;
};
template <class T>
using Vec = typename VectorOf<T>::Type;
template <class T>
inline constexpr int kWidth = 32 / static_cast<int>(sizeof(T));
template <class T>
inline constexpr int kHalfWidth = 0;  // half a vector takes as long as a whole one

TRAJOPT_ALWAYS_INLINE __m256i first_of_4(int count) {
  return _mm256_cmpgt_epi64(_mm256_set1_epi64x(count), _mm256_setr_epi64x(0, 1, 2, 3));
}
TRAJOPT_ALWAYS_INLINE __m256i first_of_8(int count) {
  return _mm256_cmpgt_epi32(_mm256_set1_epi32(count), _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7));
}

TRAJOPT_ALWAYS_INLINE __m256d broadcast(double s) { return _mm256_set1_pd(s); }
TRAJOPT_ALWAYS_INLINE __m256d load(const double* p) { return _mm256_loadu_pd(p); }
TRAJOPT_ALWAYS_INLINE void store(double* p, __m256d v) { _mm256_storeu_pd(p, v); }
TRAJOPT_ALWAYS_INLINE void stream(double* p, __m256d v) { _mm256_stream_pd(p, v); }
TRAJOPT_ALWAYS_INLINE __m256d load(const double* p, int count) {
  return _mm256_maskload_pd(p, first_of_4(count));
}
TRAJOPT_ALWAYS_INLINE void store(double* p, __m256d v, int count) {
  _mm256_maskstore_pd(p, first_of_4(count), v);
}
TRAJOPT_ALWAYS_INLINE __m256d mul(__m256d a, __m256d b) { return _mm256_mul_pd(a, b); }
TRAJOPT_ALWAYS_INLINE __m256d add(__m256d a, __m256d b) { return _mm256_add_pd(a, b); }
// c - a*b with one rounding.
TRAJOPT_ALWAYS_INLINE __m256d fnma(__m256d a, __m256d b, __m256d c) {
  return _mm256_fnmadd_pd(a, b, c);
}
// The same in the first `count` lanes, c in the others; and the other way round.
TRAJOPT_ALWAYS_INLINE __m256d fnma_first(int count, __m256d a, __m256d b, __m256d c) {
  return _mm256_blendv_pd(c, fnma(a, b, c), _mm256_castsi256_pd(first_of_4(count)));
}
TRAJOPT_ALWAYS_INLINE __m256d fnma_from(int count, __m256d a, __m256d b, __m256d c) {
  return _mm256_blendv_pd(fnma(a, b, c), c, _mm256_castsi256_pd(first_of_4(count)));
}
TRAJOPT_ALWAYS_INLINE __m256d broadcast_lane(__m256d v, int lane) {
  const int low = 2 * lane;
  const __m256i index = _mm256_setr_epi32(low, low + 1, low, low + 1, low, low + 1, low, low + 1);
  return _mm256_castps_pd(_mm256_permutevar8x32_ps(_mm256_castpd_ps(v), index));
}
// a in the first `count` lanes, b in the others.
TRAJOPT_ALWAYS_INLINE __m256d select_first(int count, __m256d a, __m256d b) {
  return _mm256_blendv_pd(b, a, _mm256_castsi256_pd(first_of_4(count)));
}

TRAJOPT_ALWAYS_INLINE __m256 broadcast(float s) { return _mm256_set1_ps(s); }
TRAJOPT_ALWAYS_INLINE __m256 load(const float* p) { return _mm256_loadu_ps(p); }
TRAJOPT_ALWAYS_INLINE void store(float* p, __m256 v) { _mm256_storeu_ps(p, v); }
TRAJOPT_ALWAYS_INLINE void stream(float* p, __m256 v) { _mm256_stream_ps(p, v); }
TRAJOPT_ALWAYS_INLINE __m256 load(const float* p, int count) {
  return _mm256_maskload_ps(p, first_of_8(count));
}
TRAJOPT_ALWAYS_INLINE void store(float* p, __m256 v, int count) {
  _mm256_maskstore_ps(p, first_of_8(count), v);
}
TRAJOPT_ALWAYS_INLINE __m256 mul(__m256 a, __m256 b) { return _mm256_mul_ps(a, b); }
TRAJOPT_ALWAYS_INLINE __m256 fnma(__m256 a, __m256 b, __m256 c) {
  return _mm256_fnmadd_ps(a, b, c);
}
TRAJOPT_ALWAYS_INLINE __m256 fnma_first(int count, __m256 a, __m256 b, __m256 c) {
  return _mm256_blendv_ps(c, fnma(a, b, c), _mm256_castsi256_ps(first_of_8(count)));
}
TRAJOPT_ALWAYS_INLINE __m256 fnma_from(int count, __m256 a, __m256 b, __m256 c) {
  return _mm256_blendv_ps(fnma(a, b, c), c, _mm256_castsi256_ps(first_of_8(count)));
}
TRAJOPT_ALWAYS_INLINE __m256 broadcast_lane(__m256 v, int lane) {
  return _mm256_permutevar8x32_ps(v, _mm256_set1_epi32(lane));
}
TRAJOPT_ALWAYS_INLINE __m256 select_first(int count, __m256 a, __m256 b) {
  return _mm256_blendv_ps(b, a, _mm256_castsi256_ps(first_of_8(count)));
}

// Pairs x0 y0 x1 y1 ... become all x and all y, and the other way round.
TRAJOPT_ALWAYS_INLINE void separate(__m256d& a, __m256d& b) {
  const __m256d x = _mm256_unpacklo_pd(a, b), y = _mm256_unpackhi_pd(a, b);
  a = _mm256_permute4x64_pd(x, 0xd8);
  b = _mm256_permute4x64_pd(y, 0xd8);
}
TRAJOPT_ALWAYS_INLINE void interleave(__m256d& a, __m256d& b) {
  const __m256d low = _mm256_unpacklo_pd(a, b), high = _mm256_unpackhi_pd(a, b);
  a = _mm256_permute2f128_pd(low, high, 0x20);
  b = _mm256_permute2f128_pd(low, high, 0x31);
}
TRAJOPT_ALWAYS_INLINE void separate(__m256& a, __m256& b) {
  const __m256 x = _mm256_shuffle_ps(a, b, 0x88), y = _mm256_shuffle_ps(a, b, 0xdd);
  a = _mm256_castpd_ps(_mm256_permute4x64_pd(_mm256_castps_pd(x), 0xd8));
  b = _mm256_castpd_ps(_mm256_permute4x64_pd(_mm256_castps_pd(y), 0xd8));
}
TRAJOPT_ALWAYS_INLINE void interleave(__m256& a, __m256& b) {
  const __m256 low = _mm256_unpacklo_ps(a, b), high = _mm256_unpackhi_ps(a, b);
  a = _mm256_permute2f128_ps(low, high, 0x20);
  b = _mm256_permute2f128_ps(low, high, 0x31);
}

TRAJOPT_ALWAYS_INLINE void transpose(__m256d (&r)[4]) {
  const __m256d a = _mm256_unpacklo_pd(r[0], r[1]), b = _mm256_unpackhi_pd(r[0], r[1]);
  const __m256d c = _mm256_unpacklo_pd(r[2], r[3]), d = _mm256_unpackhi_pd(r[2], r[3]);
  r[0] = _mm256_permute2f128_pd(a, c, 0x20);
  r[1] = _mm256_permute2f128_pd(b, d, 0x20);
  r[2] = _mm256_permute2f128_pd(a, c, 0x31);
  r[3] = _mm256_permute2f128_pd(b, d, 0x31);
}

TRAJOPT_ALWAYS_INLINE void transpose(__m256 (&r)[8]) {
  __m256 t[8];
#pragma GCC unroll 2
  for (int h = 0; h < 8; h += 4) {  // 4 x 4 squares within the 128-bit halves
    const __m256 a = _mm256_unpacklo_ps(r[h], r[h + 1]), b = _mm256_unpackhi_ps(r[h], r[h + 1]);
    const __m256 c = _mm256_unpacklo_ps(r[h + 2], r[h + 3]);
    const __m256 d = _mm256_unpackhi_ps(r[h + 2], r[h + 3]);
    t[h] = _mm256_shuffle_ps(a, c, 0x44);
    t[h + 1] = _mm256_shuffle_ps(a, c, 0xee);
    t[h + 2] = _mm256_shuffle_ps(b, d, 0x44);
    t[h + 3] = _mm256_shuffle_ps(b, d, 0xee);
  }
#pragma GCC unroll 4
  for (int i = 0; i < 4; ++i) {
    r[i] = _mm256_permute2f128_ps(t[i], t[i + 4], 0x20);
    r[i + 4] = _mm256_permute2f128_ps(t[i], t[i + 4], 0x31);
  }
}

}  // namespace trajopt::linalg::inline TRAJOPT_ISA
