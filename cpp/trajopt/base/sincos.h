// sin and cos of the project's own: the same bits on every compiler, instruction set and device.
//
// Reduction to |r| <= pi/4 by a three-part pi/2 (Cody and Waite), then the minimax polynomials in
// the form of fdlibm's kernels. Error below 2 ulp for |x| < 1e5 rad, which no joint angle leaves.
#pragma once

#include "trajopt/base/pack.h"

namespace trajopt::inline TRAJOPT_ISA {

namespace sincos_detail {
inline constexpr double kTwoOverPi = 6.36619772367581382433e-01;
inline constexpr double kPiHalf1 = 1.57079632673412561417e+00;  // 33 bits each: products are exact
inline constexpr double kPiHalf2 = 6.07710050630396597660e-11;
inline constexpr double kPiHalf3 = 2.02226624879595063154e-21;
inline constexpr double kRound = 6755399441055744.0;  // 1.5 * 2^52: adding it rounds to an integer
}  // namespace sincos_detail

template <class S>
TRAJOPT_HD inline void sincos(S x, S& sine, S& cosine) {
  using namespace sincos_detail;
  const S n = fma(x, S(kTwoOverPi), S(kRound)) - S(kRound);
  S r = fma(n, S(-kPiHalf1), x);
  r = fma(n, S(-kPiHalf2), r);
  r = fma(n, S(-kPiHalf3), r);
  const S z = r * r;
  S p = fma(z, S(1.58969099521155010221e-10), S(-2.50507602534068634195e-08));
  p = fma(z, p, S(2.75573137070700676789e-06));
  p = fma(z, p, S(-1.98412698298579493134e-04));
  p = fma(z, p, S(8.33333333332248946124e-03));
  p = fma(z, p, S(-1.66666666666666324348e-01));
  const S s = fma(z * r, p, r);
  S q = fma(z, S(-1.13596475577881948265e-11), S(2.08757232129817482790e-09));
  q = fma(z, q, S(-2.75573143513906633035e-07));
  q = fma(z, q, S(2.48015872894767294178e-05));
  q = fma(z, q, S(-1.38888888888741095749e-03));
  q = fma(z, q, S(4.16666666666666019037e-02));
  const S c = fma(z * z, q, fma(z, S(-0.5), S(1.0)));
  // Quadrant k = n mod 4 in {-2, -1, 0, 1, 2}: swap for odd k, signs by k.
  const S k = n - S(4.0) * (fma(n, S(0.25), S(kRound)) - S(kRound));
  const S odd = k * k * (S(4.0) - k * k);  // 3 for k = +-1, 0 for k = 0, +-2
  const auto swapped = odd > S(1.0);
  const S a = select(swapped, c, s);
  const S b = select(swapped, s, c);
  const S two = S(1.5);
  const S sign_sine = select((k * k) > (two * two), S(-1.0), select(S(-0.5) > k, S(-1.0), S(1.0)));
  const S sign_cosine = select((k * k) > (two * two), S(-1.0), select(k > S(0.5), S(-1.0), S(1.0)));
  sine = sign_sine * a;
  cosine = sign_cosine * b;
}

}  // namespace trajopt::inline TRAJOPT_ISA
