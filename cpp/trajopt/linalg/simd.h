// The few vector operations the linear algebra kernels are made of, per instruction set.
//
// One vector holds kWidth neighbouring elements of a row. Lanes never mix except in transpose(),
// which only moves data, so every element goes through the same scalar operations everywhere.
#pragma once

#include <cstdint>

#if defined(__AVX2__) || defined(__AVX512F__)
#include <immintrin.h>
#endif

#include "trajopt/base/hd.h"

#define TRAJOPT_ALWAYS_INLINE inline __attribute__((always_inline))

namespace trajopt::linalg::inline TRAJOPT_ISA {

#if defined(__AVX512F__)

inline constexpr int kWidth = 8;
using Vector = __m512d;

TRAJOPT_ALWAYS_INLINE Vector zero() { return _mm512_setzero_pd(); }
TRAJOPT_ALWAYS_INLINE Vector broadcast(double s) { return _mm512_set1_pd(s); }
TRAJOPT_ALWAYS_INLINE Vector load(const double* p) { return _mm512_loadu_pd(p); }
TRAJOPT_ALWAYS_INLINE void store(double* p, Vector v) { _mm512_storeu_pd(p, v); }
TRAJOPT_ALWAYS_INLINE Vector load(const double* p, int count) {
  return _mm512_maskz_loadu_pd(static_cast<__mmask8>((1u << count) - 1), p);
}
TRAJOPT_ALWAYS_INLINE void store(double* p, Vector v, int count) {
  _mm512_mask_storeu_pd(p, static_cast<__mmask8>((1u << count) - 1), v);
}
TRAJOPT_ALWAYS_INLINE Vector mul(Vector a, Vector b) { return _mm512_mul_pd(a, b); }
// c - a*b with one rounding.
TRAJOPT_ALWAYS_INLINE Vector fnma(Vector a, Vector b, Vector c) {
  return _mm512_fnmadd_pd(a, b, c);
}

// The zero-masked forms, with every lane chosen, are the plain instructions without GCC 12's false
// warning about an uninitialized pass-through operand.
TRAJOPT_ALWAYS_INLINE Vector even_quarters(Vector a, Vector b) {
  return _mm512_maskz_shuffle_f64x2(0xff, a, b, 0x88);
}
TRAJOPT_ALWAYS_INLINE Vector odd_quarters(Vector a, Vector b) {
  return _mm512_maskz_shuffle_f64x2(0xff, a, b, 0xdd);
}

TRAJOPT_ALWAYS_INLINE void transpose(Vector (&r)[8]) {
  Vector t[8], u[8];
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

#elif defined(__AVX2__) && defined(__FMA__)

inline constexpr int kWidth = 4;
using Vector = __m256d;

TRAJOPT_ALWAYS_INLINE __m256i first(int count) {
  return _mm256_cmpgt_epi64(_mm256_set1_epi64x(count), _mm256_setr_epi64x(0, 1, 2, 3));
}
TRAJOPT_ALWAYS_INLINE Vector zero() { return _mm256_setzero_pd(); }
TRAJOPT_ALWAYS_INLINE Vector broadcast(double s) { return _mm256_set1_pd(s); }
TRAJOPT_ALWAYS_INLINE Vector load(const double* p) { return _mm256_loadu_pd(p); }
TRAJOPT_ALWAYS_INLINE void store(double* p, Vector v) { _mm256_storeu_pd(p, v); }
TRAJOPT_ALWAYS_INLINE Vector load(const double* p, int count) {
  return _mm256_maskload_pd(p, first(count));
}
TRAJOPT_ALWAYS_INLINE void store(double* p, Vector v, int count) {
  _mm256_maskstore_pd(p, first(count), v);
}
TRAJOPT_ALWAYS_INLINE Vector mul(Vector a, Vector b) { return _mm256_mul_pd(a, b); }
TRAJOPT_ALWAYS_INLINE Vector fnma(Vector a, Vector b, Vector c) {
  return _mm256_fnmadd_pd(a, b, c);
}

TRAJOPT_ALWAYS_INLINE void transpose(Vector (&r)[4]) {
  const Vector a = _mm256_unpacklo_pd(r[0], r[1]), b = _mm256_unpackhi_pd(r[0], r[1]);
  const Vector c = _mm256_unpacklo_pd(r[2], r[3]), d = _mm256_unpackhi_pd(r[2], r[3]);
  r[0] = _mm256_permute2f128_pd(a, c, 0x20);
  r[1] = _mm256_permute2f128_pd(b, d, 0x20);
  r[2] = _mm256_permute2f128_pd(a, c, 0x31);
  r[3] = _mm256_permute2f128_pd(b, d, 0x31);
}

#else

inline constexpr int kWidth = 2;
struct Vector {
  double v[2];
};

TRAJOPT_ALWAYS_INLINE Vector zero() { return {{0.0, 0.0}}; }
TRAJOPT_ALWAYS_INLINE Vector broadcast(double s) { return {{s, s}}; }
TRAJOPT_ALWAYS_INLINE Vector load(const double* p) { return {{p[0], p[1]}}; }
TRAJOPT_ALWAYS_INLINE void store(double* p, Vector v) { p[0] = v.v[0], p[1] = v.v[1]; }
TRAJOPT_ALWAYS_INLINE Vector load(const double* p, int count) {
  return {{p[0], count > 1 ? p[1] : 0.0}};
}
TRAJOPT_ALWAYS_INLINE void store(double* p, Vector v, int count) {
  p[0] = v.v[0];
  if (count > 1) p[1] = v.v[1];
}
TRAJOPT_ALWAYS_INLINE Vector mul(Vector a, Vector b) {
  return {{a.v[0] * b.v[0], a.v[1] * b.v[1]}};
}
TRAJOPT_ALWAYS_INLINE Vector fnma(Vector a, Vector b, Vector c) {
  return {{__builtin_fma(-a.v[0], b.v[0], c.v[0]), __builtin_fma(-a.v[1], b.v[1], c.v[1])}};
}

TRAJOPT_ALWAYS_INLINE void transpose(Vector (&r)[2]) {
  const double s = r[0].v[1];
  r[0].v[1] = r[1].v[0];
  r[1].v[0] = s;
}

#endif

// c - a*b with one rounding.
TRAJOPT_ALWAYS_INLINE double fnma(double a, double b, double c) { return __builtin_fma(-a, b, c); }

}  // namespace trajopt::linalg::inline TRAJOPT_ISA
