// Two lanes in plain C++; included by simd.h.
#pragma once

#include "trajopt/base/hd.h"

#define TRAJOPT_ALWAYS_INLINE inline __attribute__((always_inline))

namespace trajopt::linalg::inline TRAJOPT_ISA {

template <class T>
struct Vec {
  T v[2];
  T operator[](int lane) const { return v[lane]; }
};
template <class T>
inline constexpr int kWidth = 2;
template <class T>
inline constexpr int kHalfWidth = 0;  // half a vector takes as long as a whole one

TRAJOPT_ALWAYS_INLINE double portable_fnma(double a, double b, double c) {
  return __builtin_fma(-a, b, c);
}
TRAJOPT_ALWAYS_INLINE float portable_fnma(float a, float b, float c) {
  return __builtin_fmaf(-a, b, c);
}

template <class T>
TRAJOPT_ALWAYS_INLINE Vec<T> broadcast(T s) {
  return {{s, s}};
}
template <class T>
TRAJOPT_ALWAYS_INLINE Vec<T> load(const T* p) {
  return {{p[0], p[1]}};
}
template <class T>
TRAJOPT_ALWAYS_INLINE void store(T* p, Vec<T> v) {
  p[0] = v.v[0], p[1] = v.v[1];
}
template <class T>
TRAJOPT_ALWAYS_INLINE void stream(T* p, Vec<T> v) {
  store(p, v);
}
template <class T>
TRAJOPT_ALWAYS_INLINE Vec<T> load(const T* p, int count) {
  return {{count > 0 ? p[0] : T(0), count > 1 ? p[1] : T(0)}};
}
template <class T>
TRAJOPT_ALWAYS_INLINE void store(T* p, Vec<T> v, int count) {
  if (count > 0) p[0] = v.v[0];
  if (count > 1) p[1] = v.v[1];
}
template <class T>
TRAJOPT_ALWAYS_INLINE Vec<T> mul(Vec<T> a, Vec<T> b) {
  return {{a.v[0] * b.v[0], a.v[1] * b.v[1]}};
}
template <class T>
TRAJOPT_ALWAYS_INLINE Vec<T> add(Vec<T> a, Vec<T> b) {
  return {{a.v[0] + b.v[0], a.v[1] + b.v[1]}};
}
// c - a*b with one rounding.
template <class T>
TRAJOPT_ALWAYS_INLINE Vec<T> fnma(Vec<T> a, Vec<T> b, Vec<T> c) {
  return {{portable_fnma(a.v[0], b.v[0], c.v[0]), portable_fnma(a.v[1], b.v[1], c.v[1])}};
}
// The same in the first `count` lanes, c in the others; and the other way round.
template <class T>
TRAJOPT_ALWAYS_INLINE Vec<T> fnma_first(int count, Vec<T> a, Vec<T> b, Vec<T> c) {
  const Vec<T> all = fnma(a, b, c);
  return {{count > 0 ? all.v[0] : c.v[0], count > 1 ? all.v[1] : c.v[1]}};
}
template <class T>
TRAJOPT_ALWAYS_INLINE Vec<T> fnma_from(int count, Vec<T> a, Vec<T> b, Vec<T> c) {
  const Vec<T> all = fnma(a, b, c);
  return {{count > 0 ? c.v[0] : all.v[0], count > 1 ? c.v[1] : all.v[1]}};
}
template <class T>
TRAJOPT_ALWAYS_INLINE Vec<T> broadcast_lane(Vec<T> v, int lane) {
  return {{v.v[lane], v.v[lane]}};
}
// a in the first `count` lanes, b in the others.
template <class T>
TRAJOPT_ALWAYS_INLINE Vec<T> select_first(int count, Vec<T> a, Vec<T> b) {
  return {{count > 0 ? a.v[0] : b.v[0], count > 1 ? a.v[1] : b.v[1]}};
}

// Pairs x0 y0 x1 y1 become both x and both y, and the other way round.
template <class T>
TRAJOPT_ALWAYS_INLINE void separate(Vec<T>& a, Vec<T>& b) {
  const T s = a.v[1];
  a.v[1] = b.v[0];
  b.v[0] = s;
}
template <class T>
TRAJOPT_ALWAYS_INLINE void interleave(Vec<T>& a, Vec<T>& b) {
  separate(a, b);
}

template <class T>
TRAJOPT_ALWAYS_INLINE void transpose(Vec<T> (&r)[2]) {
  const T s = r[0].v[1];
  r[0].v[1] = r[1].v[0];
  r[1].v[0] = s;
}

}  // namespace trajopt::linalg::inline TRAJOPT_ISA
