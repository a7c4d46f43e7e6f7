// What a pivot has to be, for every executor.
#pragma once

#include <cfloat>

#include "trajopt/base/hd.h"

namespace trajopt::linalg::inline TRAJOPT_ISA {

// A pivot that lost all its digits to cancellation counts as zero.
inline constexpr double kPivotZero = 4.0 * DBL_EPSILON;

// d: the pivot, `before`: the same diagonal element before any elimination. NaN is never good.
TRAJOPT_HD inline bool pivot_is_good(double d, double inverse, double sign, double before) {
  const double size = d < 0.0 ? -d : d;
  const double inverse_size = inverse < 0.0 ? -inverse : inverse;
  if (!(size <= DBL_MAX) || !(inverse_size <= DBL_MAX)) return false;
  return d * sign > 0.0 && size > kPivotZero * (before < 0.0 ? -before : before);
}

}  // namespace trajopt::linalg::inline TRAJOPT_ISA
