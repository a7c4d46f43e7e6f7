// Three-vectors, 3x3 matrices (row-major) and rigid transforms over any scalar.
#pragma once

#include "trajopt/base/pack.h"
#include "trajopt/base/sincos.h"

namespace trajopt::inline TRAJOPT_ISA {

template <class S>
struct Vec3 {
  S x, y, z;

  TRAJOPT_HD S& operator[](int i) { return i == 0 ? x : (i == 1 ? y : z); }
  TRAJOPT_HD const S& operator[](int i) const { return i == 0 ? x : (i == 1 ? y : z); }
  TRAJOPT_HD friend Vec3 operator+(const Vec3& a, const Vec3& b) {
    return {a.x + b.x, a.y + b.y, a.z + b.z};
  }
  TRAJOPT_HD friend Vec3 operator-(const Vec3& a, const Vec3& b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
  }
  TRAJOPT_HD friend Vec3 operator*(const S& s, const Vec3& a) {
    return {s * a.x, s * a.y, s * a.z};
  }
  TRAJOPT_HD Vec3& operator+=(const Vec3& b) {
    x += b.x, y += b.y, z += b.z;
    return *this;
  }
  TRAJOPT_HD Vec3& operator-=(const Vec3& b) {
    x -= b.x, y -= b.y, z -= b.z;
    return *this;
  }
};

template <class S>
TRAJOPT_HD inline Vec3<S> broadcast3(const double* a) {
  return {S(a[0]), S(a[1]), S(a[2])};
}

template <class S>
TRAJOPT_HD inline S dot(const Vec3<S>& a, const Vec3<S>& b) {
  return fma(a.z, b.z, fma(a.y, b.y, a.x * b.x));
}

template <class S>
TRAJOPT_HD inline Vec3<S> cross(const Vec3<S>& a, const Vec3<S>& b) {
  return {fma(a.y, b.z, -(a.z * b.y)), fma(a.z, b.x, -(a.x * b.z)), fma(a.x, b.y, -(a.y * b.x))};
}

// s*a + b
template <class S>
TRAJOPT_HD inline Vec3<S> fma(const S& s, const Vec3<S>& a, const Vec3<S>& b) {
  return {fma(s, a.x, b.x), fma(s, a.y, b.y), fma(s, a.z, b.z)};
}

template <class S>
struct Mat3 {
  S m[9];

  TRAJOPT_HD S& operator()(int i, int j) { return m[3 * i + j]; }
  TRAJOPT_HD const S& operator()(int i, int j) const { return m[3 * i + j]; }
  TRAJOPT_HD Vec3<S> column(int j) const { return {m[j], m[3 + j], m[6 + j]}; }
  TRAJOPT_HD Mat3& operator+=(const Mat3& b) {
    for (int i = 0; i < 9; ++i) m[i] += b.m[i];
    return *this;
  }
};

template <class S>
TRAJOPT_HD inline Vec3<S> operator*(const Mat3<S>& a, const Vec3<S>& b) {
  Vec3<S> r;
  for (int i = 0; i < 3; ++i) r[i] = fma(a(i, 2), b.z, fma(a(i, 1), b.y, a(i, 0) * b.x));
  return r;
}

template <class S>
TRAJOPT_HD inline Vec3<S> transposed_times(const Mat3<S>& a, const Vec3<S>& b) {
  Vec3<S> r;
  for (int i = 0; i < 3; ++i) r[i] = fma(a(2, i), b.z, fma(a(1, i), b.y, a(0, i) * b.x));
  return r;
}

template <class S>
TRAJOPT_HD inline Mat3<S> operator*(const Mat3<S>& a, const Mat3<S>& b) {
  Mat3<S> r;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      r(i, j) = fma(a(i, 2), b(2, j), fma(a(i, 1), b(1, j), a(i, 0) * b(0, j)));
  return r;
}

template <class S>
TRAJOPT_HD inline Mat3<S> identity3() {
  Mat3<S> r;
  for (int i = 0; i < 9; ++i) r.m[i] = S(i % 4 == 0 ? 1.0 : 0.0);
  return r;
}

// r += s * a b^T
template <class S>
TRAJOPT_HD inline void add_outer(Mat3<S>& r, const S& s, const Vec3<S>& a, const Vec3<S>& b) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) r(i, j) = fma(s * a[i], b[j], r(i, j));
}

template <class S>
struct Transform {  // P = rotation p + translation
  Mat3<S> rotation;
  Vec3<S> translation;
};

// Always inlined: a large file uses up what GCC thinks it may grow by.
template <class S>
__attribute__((always_inline)) TRAJOPT_HD inline Vec3<S> apply(const Transform<S>& t,
                                                               const Vec3<S>& p) {
  return t.rotation * p + t.translation;
}

// Rotation about the constant unit `axis` with sine s and cosine c.
template <class S>
TRAJOPT_HD inline Mat3<S> axis_rotation(const double* axis, const S& s, const S& c) {
  const S v = S(1.0) - c;
  const double x = axis[0], y = axis[1], z = axis[2];
  Mat3<S> r;
  r(0, 0) = fma(v, S(x * x), c);
  r(1, 1) = fma(v, S(y * y), c);
  r(2, 2) = fma(v, S(z * z), c);
  r(0, 1) = fma(v, S(x * y), S(-z) * s);
  r(1, 0) = fma(v, S(x * y), S(z) * s);
  r(0, 2) = fma(v, S(x * z), S(y) * s);
  r(2, 0) = fma(v, S(x * z), S(-y) * s);
  r(1, 2) = fma(v, S(y * z), S(-x) * s);
  r(2, 1) = fma(v, S(y * z), S(x) * s);
  return r;
}

// Rotation matrix of a unit quaternion (w, x, y, z).
template <class S>
TRAJOPT_HD inline Mat3<S> quaternion_matrix(const S* q) {
  const S w = q[0], x = q[1], y = q[2], z = q[3];
  const S two = S(2.0), one = S(1.0);
  Mat3<S> r;
  r(0, 0) = one - two * fma(y, y, z * z);
  r(1, 1) = one - two * fma(x, x, z * z);
  r(2, 2) = one - two * fma(x, x, y * y);
  r(0, 1) = two * fma(x, y, -(w * z));
  r(1, 0) = two * fma(x, y, w * z);
  r(0, 2) = two * fma(x, z, w * y);
  r(2, 0) = two * fma(x, z, -(w * y));
  r(1, 2) = two * fma(y, z, -(w * x));
  r(2, 1) = two * fma(y, z, w * x);
  return r;
}

}  // namespace trajopt::inline TRAJOPT_ISA
