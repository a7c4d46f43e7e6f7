// Eight doubles or sixteen floats; included by simd.h.
#pragma once

#include <immintrin.h>

#include "trajopt/base/hd.h"

#define TRAJOPT_ALWAYS_INLINE inline __attribute__((always_inline))

namespace trajopt::linalg::inline TRAJOPT_ISA {

template <class T>
struct VectorOf;
template <>
struct VectorOf<double> {
  using Type = __m512d;
};
template <>
struct VectorOf<float> {
  using Type = __m512;
};
template <class T>
using Vec = typename VectorOf<T>::Type;
template <class T>
inline constexpr int kWidth = 64 / static_cast<int>(sizeof(T));

TRAJOPT_ALWAYS_INLINE __mmask8 first_of_8(int count) {
  return static_cast<__mmask8>((1u << count) - 1);
}
TRAJOPT_ALWAYS_INLINE __mmask16 first_of_16(int count) {
  return static_cast<__mmask16>((1u << count) - 1);
}

TRAJOPT_ALWAYS_INLINE __m512d broadcast(double s) { return _mm512_set1_pd(s); }
TRAJOPT_ALWAYS_INLINE __m512d load(const double* p) { return _mm512_loadu_pd(p); }
TRAJOPT_ALWAYS_INLINE void store(double* p, __m512d v) { _mm512_storeu_pd(p, v); }
TRAJOPT_ALWAYS_INLINE void stream(double* p, __m512d v) { _mm512_stream_pd(p, v); }
TRAJOPT_ALWAYS_INLINE __m512d load(const double* p, int count) {
  return _mm512_maskz_loadu_pd(first_of_8(count), p);
}
TRAJOPT_ALWAYS_INLINE void store(double* p, __m512d v, int count) {
  _mm512_mask_storeu_pd(p, first_of_8(count), v);
}
TRAJOPT_ALWAYS_INLINE __m512d mul(__m512d a, __m512d b) { return _mm512_mul_pd(a, b); }
TRAJOPT_ALWAYS_INLINE __m512d add(__m512d a, __m512d b) { return _mm512_add_pd(a, b); }
// c - a*b with one rounding.
TRAJOPT_ALWAYS_INLINE __m512d fnma(__m512d a, __m512d b, __m512d c) {
  return _mm512_fnmadd_pd(a, b, c);
}
// The first half of a vector of doubles: on some processors an operation takes half the time.
template <class T>
inline constexpr int kHalfWidth = 0;  // there are none of this scalar
template <>
inline constexpr int kHalfWidth<double> = 4;
// By shuffles that are no instructions: GCC 12 takes the casts for uses of uninitialized operands.
TRAJOPT_ALWAYS_INLINE __m256d first_half(__m512d v) {
  return __builtin_shufflevector(v, v, 0, 1, 2, 3);
}
TRAJOPT_ALWAYS_INLINE __m512d widen(__m256d half) {
  return __builtin_shufflevector(half, __m256d{}, 0, 1, 2, 3, 4, 5, 6, 7);
}
TRAJOPT_ALWAYS_INLINE __m256d fnma(double a, __m256d b, __m256d c) {
  return _mm256_fnmadd_pd(_mm256_set1_pd(a), b, c);
}
// The same in the first `count` lanes, c in the others; and the other way round.
TRAJOPT_ALWAYS_INLINE __m512d fnma_first(int count, __m512d a, __m512d b, __m512d c) {
  return _mm512_mask3_fnmadd_pd(a, b, c, first_of_8(count));
}
TRAJOPT_ALWAYS_INLINE __m512d fnma_from(int count, __m512d a, __m512d b, __m512d c) {
  return _mm512_mask3_fnmadd_pd(a, b, c, static_cast<__mmask8>(~first_of_8(count)));
}
// Indices for broadcast_lane. Defined in linalg_kernels.cpp: as constants the compiler would build
// them in general registers, which costs more than the permutation.
struct LaneIndex {
  alignas(64) long long of_8[8][8];
  alignas(64) int of_16[16][16];
};
extern const LaneIndex kLaneIndex;

// The zero-masked forms, with every lane chosen, are the plain instructions without GCC 12's false
// warning about an uninitialized pass-through operand.
TRAJOPT_ALWAYS_INLINE __m512d broadcast_lane(__m512d v, int lane) {
  return _mm512_maskz_permutexvar_pd(0xff, _mm512_load_si512(kLaneIndex.of_8[lane]), v);
}

// a in the first `count` lanes, b in the others.
TRAJOPT_ALWAYS_INLINE __m512d select_first(int count, __m512d a, __m512d b) {
  return _mm512_mask_blend_pd(first_of_8(count), b, a);
}

TRAJOPT_ALWAYS_INLINE __m512 broadcast(float s) { return _mm512_set1_ps(s); }
TRAJOPT_ALWAYS_INLINE __m512 load(const float* p) { return _mm512_loadu_ps(p); }
TRAJOPT_ALWAYS_INLINE void store(float* p, __m512 v) { _mm512_storeu_ps(p, v); }
TRAJOPT_ALWAYS_INLINE void stream(float* p, __m512 v) { _mm512_stream_ps(p, v); }
TRAJOPT_ALWAYS_INLINE __m512 load(const float* p, int count) {
  return _mm512_maskz_loadu_ps(first_of_16(count), p);
}
TRAJOPT_ALWAYS_INLINE void store(float* p, __m512 v, int count) {
  _mm512_mask_storeu_ps(p, first_of_16(count), v);
}
TRAJOPT_ALWAYS_INLINE __m512 mul(__m512 a, __m512 b) { return _mm512_mul_ps(a, b); }
TRAJOPT_ALWAYS_INLINE __m512 fnma(__m512 a, __m512 b, __m512 c) {
  return _mm512_fnmadd_ps(a, b, c);
}
TRAJOPT_ALWAYS_INLINE __m512 fnma_first(int count, __m512 a, __m512 b, __m512 c) {
  return _mm512_mask3_fnmadd_ps(a, b, c, first_of_16(count));
}
TRAJOPT_ALWAYS_INLINE __m512 fnma_from(int count, __m512 a, __m512 b, __m512 c) {
  return _mm512_mask3_fnmadd_ps(a, b, c, static_cast<__mmask16>(~first_of_16(count)));
}
TRAJOPT_ALWAYS_INLINE __m512 broadcast_lane(__m512 v, int lane) {
  return _mm512_maskz_permutexvar_ps(0xffff, _mm512_load_si512(kLaneIndex.of_16[lane]), v);
}
TRAJOPT_ALWAYS_INLINE __m512 select_first(int count, __m512 a, __m512 b) {
  return _mm512_mask_blend_ps(first_of_16(count), b, a);
}

// Pairs x0 y0 x1 y1 ... become all x and all y, and the other way round.
TRAJOPT_ALWAYS_INLINE void separate(__m512d& a, __m512d& b) {
  const __m512i even = _mm512_setr_epi64(0, 2, 4, 6, 8, 10, 12, 14);
  const __m512i odd = _mm512_setr_epi64(1, 3, 5, 7, 9, 11, 13, 15);
  const __m512d x = _mm512_permutex2var_pd(a, even, b);
  b = _mm512_permutex2var_pd(a, odd, b);
  a = x;
}
TRAJOPT_ALWAYS_INLINE void interleave(__m512d& a, __m512d& b) {
  const __m512i low = _mm512_setr_epi64(0, 8, 1, 9, 2, 10, 3, 11);
  const __m512i high = _mm512_setr_epi64(4, 12, 5, 13, 6, 14, 7, 15);
  const __m512d x = _mm512_permutex2var_pd(a, low, b);
  b = _mm512_permutex2var_pd(a, high, b);
  a = x;
}
TRAJOPT_ALWAYS_INLINE void separate(__m512& a, __m512& b) {
  const __m512i even = _mm512_setr_epi32(0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30);
  const __m512i odd = _mm512_setr_epi32(1, 3, 5, 7, 9, 11, 13, 15, 17, 19, 21, 23, 25, 27, 29, 31);
  const __m512 x = _mm512_permutex2var_ps(a, even, b);
  b = _mm512_permutex2var_ps(a, odd, b);
  a = x;
}
TRAJOPT_ALWAYS_INLINE void interleave(__m512& a, __m512& b) {
  const __m512i low = _mm512_setr_epi32(0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23);
  const __m512i high =
      _mm512_setr_epi32(8, 24, 9, 25, 10, 26, 11, 27, 12, 28, 13, 29, 14, 30, 15, 31);
  const __m512 x = _mm512_permutex2var_ps(a, low, b);
  b = _mm512_permutex2var_ps(a, high, b);
  a = x;
}

TRAJOPT_ALWAYS_INLINE __m512d even_quarters(__m512d a, __m512d b) {
  return _mm512_maskz_shuffle_f64x2(0xff, a, b, 0x88);
}
TRAJOPT_ALWAYS_INLINE __m512d odd_quarters(__m512d a, __m512d b) {
  return _mm512_maskz_shuffle_f64x2(0xff, a, b, 0xdd);
}

TRAJOPT_ALWAYS_INLINE void transpose(__m512d (&r)[8]) {
  __m512d t[8], u[8];
#pragma GCC unroll 4
  for (int i = 0; i < 8; i += 2) {
    t[i] = _mm512_maskz_unpacklo_pd(0xff, r[i], r[i + 1]);
    t[i + 1] = _mm512_maskz_unpackhi_pd(0xff, r[i], r[i + 1]);
  }
#pragma GCC unroll 4
  for (int i = 0; i < 8; i += 4) {
#pragma GCC unroll 2
    for (int j = i; j < i + 2; ++j) {
      u[j] = even_quarters(t[j], t[j + 2]);
      u[j + 2] = odd_quarters(t[j], t[j + 2]);
    }
  }
#pragma GCC unroll 2
  for (int i = 0; i < 2; ++i) {
    r[i] = even_quarters(u[i], u[i + 4]);
    r[i + 4] = odd_quarters(u[i], u[i + 4]);
    r[i + 2] = even_quarters(u[i + 2], u[i + 6]);
    r[i + 6] = odd_quarters(u[i + 2], u[i + 6]);
  }
}

// One round of a transposition: rows i and i + H exchange their off-diagonal H x H squares.
template <int H>
struct Exchange {
  alignas(64) int upper[16], lower[16];  // lanes of a row and, from 16 on, of its partner
  constexpr Exchange() : upper(), lower() {
    for (int l = 0; l < 16; ++l) {
      upper[l] = l & H ? 16 + l - H : l;
      lower[l] = l & H ? 16 + l : l + H;
    }
  }
};

template <int H>
TRAJOPT_ALWAYS_INLINE void exchange(__m512 (&r)[16]) {
  static constexpr Exchange<H> kIndex;
  const __m512i upper = _mm512_load_si512(kIndex.upper), lower = _mm512_load_si512(kIndex.lower);
#pragma GCC unroll 16
  for (int i = 0; i < 16; ++i) {
    if (i & H) continue;
    const __m512 a = r[i], b = r[i + H];
    r[i] = _mm512_permutex2var_ps(a, upper, b);
    r[i + H] = _mm512_permutex2var_ps(a, lower, b);
  }
}

TRAJOPT_ALWAYS_INLINE void transpose(__m512 (&r)[16]) {
  exchange<1>(r);
  exchange<2>(r);
  exchange<4>(r);
  exchange<8>(r);
}

}  // namespace trajopt::linalg::inline TRAJOPT_ISA
