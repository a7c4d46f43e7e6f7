// Pack<W>: W doubles in one SIMD register, one frame (or one problem) per lane.
//
// Every formula is a template over its scalar. Instantiated with `double` it is the definition;
// instantiated with `Pack<W>` it evaluates W independent copies. Lanes never mix, and each
// operation is the IEEE one, so lane i of the result has the bits of the scalar run.
#pragma once

#include <cmath>
#include <cstdint>
#include <type_traits>

#if defined(__AVX2__) || defined(__AVX512F__)
#include <immintrin.h>
#endif

#include "trajopt/base/hd.h"

namespace trajopt::inline TRAJOPT_ISA {

template <int W>
struct PackTypes;  // spelled out: GCC ignores a vector_size that depends on a template parameter
#define TRAJOPT_PACK_TYPES(W)                                      \
  template <>                                                      \
  struct PackTypes<W> {                                            \
    typedef double Vector __attribute__((vector_size((W)*8)));     \
    typedef std::int64_t Mask __attribute__((vector_size((W)*8))); \
  }
TRAJOPT_PACK_TYPES(2);
TRAJOPT_PACK_TYPES(4);
TRAJOPT_PACK_TYPES(8);
#undef TRAJOPT_PACK_TYPES

#if defined(__AVX512F__)
// One bit a lane, as AVX-512 compares and blends; the narrower packs use full-width masks.
struct Mask8 {
  __mmask8 bits;
};
template <int W>
using MaskOf = std::conditional_t<W == 8, Mask8, typename PackTypes<W>::Mask>;
#else
template <int W>
using MaskOf = typename PackTypes<W>::Mask;
#endif

template <int W>
struct Pack {
  using Vector = typename PackTypes<W>::Vector;
  using Mask = MaskOf<W>;

  Vector v;

  Pack() = default;
  Pack(double s) {  // NOLINT(google-explicit-constructor): scalars are constants of every lane
#if defined(__AVX512F__)
    if constexpr (W == 8) {
      v = (Vector)_mm512_set1_pd(s);
      return;
    }
#endif
#if defined(__AVX2__)
    if constexpr (W == 4) {
      v = (Vector)_mm256_set1_pd(s);
      return;
    }
#endif
    for (int i = 0; i < W; ++i) v[i] = s;
  }
  Pack(Vector x) : v(x) {}  // NOLINT(google-explicit-constructor)

  double operator[](int i) const { return v[i]; }
  void set(int i, double s) { v[i] = s; }

  friend Pack operator+(Pack a, Pack b) { return a.v + b.v; }
  friend Pack operator-(Pack a, Pack b) { return a.v - b.v; }
  friend Pack operator*(Pack a, Pack b) { return a.v * b.v; }
  friend Pack operator/(Pack a, Pack b) { return a.v / b.v; }
  friend Pack operator-(Pack a) { return -a.v; }
  Pack& operator+=(Pack b) { return v += b.v, *this; }
  Pack& operator-=(Pack b) { return v -= b.v, *this; }
  Pack& operator*=(Pack b) { return v *= b.v, *this; }
  friend Mask operator<(Pack a, Pack b) {
#if defined(__AVX512F__)
    if constexpr (W == 8)
      return {_mm512_cmp_pd_mask((__m512d)a.v, (__m512d)b.v, _CMP_LT_OQ)};
    else
#endif
      return a.v < b.v;
  }
  friend Mask operator>(Pack a, Pack b) { return b < a; }
};

template <class S>
inline constexpr int lanes = 1;
template <int W>
inline constexpr int lanes<Pack<W>> = W;

template <class S>
TRAJOPT_HD inline double lane(const S& x, int i) {
  if constexpr (lanes<S> == 1) {
    return x;
  } else {
    return x[i];
  }
}
template <class S>
TRAJOPT_HD inline void set_lane(S& x, int i, double value) {
  if constexpr (lanes<S> == 1) {
    x = value;
  } else {
    x.set(i, value);
  }
}

// a*b + c with one rounding. Written out everywhere it is meant: compilers do not contract.
TRAJOPT_HD inline double fma(double a, double b, double c) { return __builtin_fma(a, b, c); }
template <int W>
inline Pack<W> fma(Pack<W> a, Pack<W> b, Pack<W> c) {
#if defined(__AVX512F__)
  if constexpr (W == 8)
    return Pack<W>(
        (typename Pack<W>::Vector)_mm512_fmadd_pd((__m512d)a.v, (__m512d)b.v, (__m512d)c.v));
#endif
#if defined(__FMA__)
  if constexpr (W == 4)
    return Pack<W>(
        (typename Pack<W>::Vector)_mm256_fmadd_pd((__m256d)a.v, (__m256d)b.v, (__m256d)c.v));
#endif
  Pack<W> r;
  for (int i = 0; i < W; ++i) r.v[i] = __builtin_fma(a.v[i], b.v[i], c.v[i]);
  return r;
}

// The same number, in a register: for an operand of several multiply-adds, each of which GCC would
// else load anew, though a core loads less in a cycle than it multiplies.
TRAJOPT_HD inline double in_register(double a) { return a; }
template <int W>
inline Pack<W> in_register(Pack<W> a) {
#if defined(__AVX512F__)
  if constexpr (W == 8) asm("" : "+v"(a.v));
#endif
#if defined(__AVX2__)
  if constexpr (W == 4) asm("" : "+x"(a.v));
#endif
  return a;
}

TRAJOPT_HD inline double sqrt(double a) { return __builtin_sqrt(a); }
template <int W>
inline Pack<W> sqrt(Pack<W> a) {
#if defined(__AVX512F__)
  if constexpr (W == 8)
    return Pack<W>((typename Pack<W>::Vector)_mm512_maskz_sqrt_pd(0xff, (__m512d)a.v));
#endif
#if defined(__AVX2__)
  if constexpr (W == 4) return Pack<W>((typename Pack<W>::Vector)_mm256_sqrt_pd((__m256d)a.v));
#endif
  Pack<W> r;
  for (int i = 0; i < W; ++i) r.v[i] = __builtin_sqrt(a.v[i]);
  return r;
}

TRAJOPT_HD inline double select(bool m, double a, double b) { return m ? a : b; }
template <int W>
inline Pack<W> select(typename Pack<W>::Mask m, Pack<W> a, Pack<W> b) {
#if defined(__AVX512F__)
  if constexpr (W == 8)
    return Pack<W>(
        (typename Pack<W>::Vector)_mm512_mask_blend_pd(m.bits, (__m512d)b.v, (__m512d)a.v));
  else
#endif
    return m ? a.v : b.v;
}

TRAJOPT_HD inline bool any(bool m) { return m; }
#if defined(__AVX512F__)
inline bool any(Mask8 m) { return m.bits != 0; }
#endif
template <class Mask>
requires(!std::is_arithmetic_v<Mask>) inline bool any(Mask m) {
#if defined(__AVX2__)
  if constexpr (sizeof(Mask) == 32) return _mm256_movemask_pd((__m256d)m) != 0;
#endif
  std::int64_t r = 0;
  for (unsigned i = 0; i < sizeof(Mask) / sizeof(std::int64_t); ++i) r |= m[i];
  return r != 0;
}

template <class S>
TRAJOPT_HD inline S max(S a, S b) {
  return select(a > b, a, b);
}

}  // namespace trajopt::inline TRAJOPT_ISA
