#include "trajopt/solver/frames_executor.h"

#include "trajopt/base/error.h"

namespace trajopt {

void require_device_support(const TrajectoryProblem& problem, const std::string& device) {
  std::string what;
  const auto add = [&](const std::string& part) { what += (what.empty() ? "" : ", ") + part; };
  if (problem.options().formulation == Formulation::spline) add("the spline formulation");
  if (what.empty()) return;
  throw DeviceError("device " + device + " does not support " + what +
                    ": solve this problem with device cpu");
}

}  // namespace trajopt
