// What a failed pivot is called, by every executor.
#pragma once

#include <cmath>
#include <cstdio>

#include "trajopt/base/error.h"

namespace trajopt::linalg {

// As it is printed: which sign a NaN has depends on the machine.
inline double printed(double value) { return std::isnan(value) ? std::abs(value) : value; }

// item < 0: the only problem there is.
inline FactorizationError pivot_error(int item, int block, int row, double value, bool positive,
                                      double regularization) {
  const char* reason = "is zero to working accuracy";
  if (!std::isfinite(value)) {
    reason = "is not finite";
  } else if (positive ? value < 0.0 : value > 0.0) {
    reason = "has the wrong sign";
  }
  char text[256];
  char where[48] = "";
  if (item >= 0) std::snprintf(where, sizeof where, " of problem %d", item);
  std::snprintf(text, sizeof text,
                "pivot %d of block %d%s is %g, which %s: expected a %s one (regularization %g)",
                row, block, where, printed(value), reason, positive ? "positive" : "negative",
                regularization);
  return FactorizationError(text, block, row);
}

// The border counts as the block behind the last.
inline FactorizationError border_pivot_error(int item, int blocks, int row, double value,
                                             bool positive, double regularization) {
  char text[256];
  char where[48] = "";
  if (item >= 0) std::snprintf(where, sizeof where, " of problem %d", item);
  std::snprintf(text, sizeof text,
                "pivot %d of the border (block %d)%s is %g: expected a %s one (regularization %g)",
                row, blocks, where, printed(value), positive ? "positive" : "negative",
                regularization);
  return FactorizationError(text, blocks, row);
}

}  // namespace trajopt::linalg
