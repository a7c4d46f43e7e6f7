// The power of two that a column is divided by before float32 factors solve for it.
#pragma once

#include <bit>
#include <cstdint>
#include <limits>

#include "trajopt/base/hd.h"

namespace trajopt::linalg::inline TRAJOPT_ISA {

// 2^clamp(ilogb(most), -1000, 1000): a column whose largest magnitude is `most` comes to lie in the
// middle of float32's range. 1 for a column of zeros and for one that is not finite.
TRAJOPT_HD inline double column_scale(double most) {
  constexpr int kBias = 1023, kMantissa = 52, kLargest = 1000;
  if (!(most > 0.0 && most <= std::numeric_limits<double>::max())) return 1.0;
  // A subnormal number has 0 in its exponent's place: -1023, which is below -1000 too.
  const int exponent = static_cast<int>(std::bit_cast<std::uint64_t>(most) >> kMantissa) - kBias;
  const int kept = exponent < -kLargest ? -kLargest : (exponent > kLargest ? kLargest : exponent);
  return std::bit_cast<double>(static_cast<std::uint64_t>(kept + kBias) << kMantissa);
}

}  // namespace trajopt::linalg::inline TRAJOPT_ISA
