// What a pivot has to be, for every executor.
#pragma once

#include <limits>

#include "trajopt/base/hd.h"

namespace trajopt::linalg::inline TRAJOPT_ISA {

// A pivot that lost all its digits to cancellation counts as zero.
template <class T>
inline constexpr T kPivotZero = 4 * std::numeric_limits<T>::epsilon();

// d: the pivot, `before`: the same diagonal element before any elimination. NaN is never good.
template <class T>
TRAJOPT_HD inline bool pivot_is_good(T d, T inverse, T sign, T before) {
  constexpr T kMost = std::numeric_limits<T>::max(), kZero = kPivotZero<T>;
  const T size = d < 0 ? -d : d;
  const T inverse_size = inverse < 0 ? -inverse : inverse;
  if (!(size <= kMost) || !(inverse_size <= kMost)) return false;
  return d * sign > 0 && size > kZero * (before < 0 ? -before : before);
}

}  // namespace trajopt::linalg::inline TRAJOPT_ISA
