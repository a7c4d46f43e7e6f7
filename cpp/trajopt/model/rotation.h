// Rotation vectors, quaternions and the left Jacobian of SO(3).
//
//   exp([r]) R with d exp = [J_l(r) dr] exp,   J_l = a I + b [r] + c r r^T,
//   a = sin t / t, b = (1 - cos t)/t^2, c = (1 - a)/t^2, t = |r|.
#pragma once

#include "trajopt/base/vec3.h"

namespace trajopt::inline TRAJOPT_ISA {

template <class S>
struct ExpCoefficients {  // and their derivatives divided by t: a'/t, b'/t, c'/t
  S a, b, c, da, db, dc;
};

template <class S>
TRAJOPT_HD inline ExpCoefficients<S> exp_series(S t2) {  // for small t: the closed forms cancel
  const S one(1.0);
  return {one - t2 / S(6.0) * (one - t2 / S(20.0) * (one - t2 / S(42.0))),
          S(0.5) - t2 / S(24.0) * (one - t2 / S(30.0) * (one - t2 / S(56.0))),
          S(1.0 / 6) - t2 / S(120.0) * (one - t2 / S(42.0) * (one - t2 / S(72.0))),
          S(-1.0 / 3) + t2 / S(30.0) - t2 * t2 / S(840.0),
          S(-1.0 / 12) + t2 / S(180.0) - t2 * t2 / S(6720.0),
          S(-1.0 / 60) + t2 / S(1260.0) - t2 * t2 / S(60480.0)};
}

template <class S>
TRAJOPT_HD inline ExpCoefficients<S> exp_closed(S t2) {
  const S t = sqrt(t2), one(1.0), two(2.0);
  S s, c;
  sincos(t, s, c);
  S sh, ch;
  sincos(S(0.5) * t, sh, ch);
  const S a = s / t, b = two * sh * sh / t2, cc = (one - a) / t2;
  return {a, b, cc, (c - a) / t2, (a - two * b) / t2, (b - S(3.0) * cc) / t2};
}

template <class S>
TRAJOPT_HD inline ExpCoefficients<S> exp_coefficients(S t2) {
  const S small(1e-4);
  if constexpr (lanes<S> == 1) {
    return t2 < small ? exp_series(t2) : exp_closed(t2);
  } else {
    const auto near = t2 < small;
    if (!any(near)) return exp_closed(t2);
    const ExpCoefficients<S> x = exp_series(t2), y = exp_closed(t2);
    return {select(near, x.a, y.a),   select(near, x.b, y.b),   select(near, x.c, y.c),
            select(near, x.da, y.da), select(near, x.db, y.db), select(near, x.dc, y.dc)};
  }
}

template <class S>
TRAJOPT_HD inline Mat3<S> left_jacobian(const Vec3<S>& r) {
  const ExpCoefficients<S> k = exp_coefficients(dot(r, r));
  Mat3<S> j = identity3<S>();
  for (S& e : j.m) e *= k.a;
  const S zero(0.0);
  const S x[9] = {zero, -r.z, r.y, r.z, zero, -r.x, -r.y, r.x, zero};
  for (int i = 0; i < 9; ++i) j.m[i] = fma(k.b, x[i], j.m[i]);
  add_outer(j, k.c, r, r);
  return j;
}

// J_l(r)^-1 = I - [r]/2 + k [r]^2, k = 1/t^2 - (1 + cos t)/(2 t sin t)
TRAJOPT_HD inline Mat3<double> left_jacobian_inverse(const Vec3<double>& r) {
  const double t2 = dot(r, r);
  double k;
  if (t2 < 1e-4) {
    k = 1.0 / 12 + t2 / 720 + t2 * t2 / 30240;
  } else {
    const double t = sqrt(t2);
    double s, c;
    sincos(0.5 * t, s, c);
    k = 1 / t2 - c / (2 * t * s);  // (1 + cos t)/sin t = cot(t/2)
  }
  Mat3<double> j = identity3<double>();
  const double x[9] = {0, -r.z, r.y, r.z, 0, -r.x, -r.y, r.x, 0};
  for (int i = 0; i < 9; ++i) j.m[i] = fma(-0.5, x[i], j.m[i]);
  add_outer(j, k, r, r);  // [r]^2 = r r^T - t^2 I
  for (int i = 0; i < 3; ++i) j(i, i) -= k * t2;
  return j;
}

template <class S>
TRAJOPT_HD inline void quaternion_exp(const Vec3<S>& r, S* q) {
  const S t2 = dot(r, r), one_half(0.5);
  const ExpCoefficients<S> half = exp_coefficients(S(0.25) * t2);  // a = sin(t/2)/(t/2)
  S s, c;
  sincos(one_half * sqrt(t2), s, c);
  q[0] = c;
  q[1] = one_half * half.a * r.x;
  q[2] = one_half * half.a * r.y;
  q[3] = one_half * half.a * r.z;
}

TRAJOPT_HD inline void quaternion_exp(const Vec3<double>& r, double* q) {
  quaternion_exp<double>(r, q);
}

TRAJOPT_HD inline void quaternion_product(const double* a, const double* b, double* r) {
  const double w = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3];
  const double x = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2];
  const double y = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1];
  const double z = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0];
  const double n = 1 / sqrt(w * w + x * x + y * y + z * z);
  r[0] = n * w, r[1] = n * x, r[2] = n * y, r[3] = n * z;
}

// atan z for 0 <= z < 7/16: fdlibm's polynomial.
TRAJOPT_HD inline double atan_small(double z) {
  const double w = z * z;
  double p = fma(w, 1.62858201153657823623e-02, -3.65315727442169155270e-02);
  p = fma(w, p, 4.97687799461593236017e-02);
  p = fma(w, p, -5.83357013379057348645e-02);
  p = fma(w, p, 6.66107313738753120669e-02);
  p = fma(w, p, -7.69187620504482999495e-02);
  p = fma(w, p, 9.09088713343650656196e-02);
  p = fma(w, p, -1.11111104054623557880e-01);
  p = fma(w, p, 1.42857142725034663711e-01);
  p = fma(w, p, -1.99999999998764832476e-01);
  p = fma(w, p, 3.33333333333329318027e-01);
  return fma(-z * w, p, z);
}

// Rotation vector, |r| <= pi, of the unit quaternion q.
TRAJOPT_HD inline Vec3<double> quaternion_log(const double* q) {
  const double sign = q[0] < 0 ? -1.0 : 1.0;
  const double s2 = q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
  const double s = sqrt(s2), w = sign * q[0];
  const double u = s / (1 + w);                // tan of a quarter of the angle
  const double z = u / (1 + sqrt(1 + u * u));  // tan of an eighth: at most 0.4142
  const double angle = 8 * atan_small(z);
  const double k = s > 1e-300 ? sign * angle / s : sign * 2.0;
  return {k * q[1], k * q[2], k * q[3]};
}

// Rotation vector, |r| <= pi, of a b^-1: the tangent that carries b to a.
TRAJOPT_HD inline Vec3<double> quaternion_difference(const double* a, const double* b) {
  const double conjugate[4] = {b[0], -b[1], -b[2], -b[3]};
  double r[4];
  quaternion_product(a, conjugate, r);
  return quaternion_log(r);
}

}  // namespace trajopt::inline TRAJOPT_ISA
