#include "trajopt/solver/executor.h"

#include <algorithm>
#include <cmath>

namespace trajopt {

bool PointValues::finite() const {
  return std::isfinite(objective) && std::isfinite(constraint_norm) &&
         std::isfinite(frame_violation);
}

namespace {

double norm2(const StepValues& v, double ct, double cn) {
  return ct * ct * v.item[kTangentialNorm2] + 2 * ct * cn * v.item[kMixedNorm2] +
         cn * cn * v.item[kNormalNorm2];
}

}  // namespace

double StepValues::norm(double ct, double cn) const {
  return std::sqrt(std::max(norm2(*this, ct, cn), 0.0));
}

double StepValues::predicted_decrease(double ct, double cn, double damping,
                                      double augmentation) const {
  const double linear = ct * item[kTangentialSlope] + cn * item[kNormalSlope];
  const double damped = -ct * ct * item[kTangentialSlope] + cn * cn * item[kNormalCurvature];
  const double added = damping * norm2(*this, ct, cn) + augmentation * cn * cn * item[kConstraint2];
  return -(linear + 0.5 * (damped - added));
}

}  // namespace trajopt
