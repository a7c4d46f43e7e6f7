// Solving on a GPU where there is none. The driver, if any, is told to show none.
#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

#include "solver/flight.h"
#include "trajopt/base/error.h"
#include "trajopt/cuda/base/device.h"
#include "trajopt/cuda/solver/executor.h"
#include "trajopt/solver/funnel_sqp.h"

namespace trajopt::cuda {
namespace {

const bool kHidden = setenv("CUDA_VISIBLE_DEVICES", "", 1) == 0;

std::string refusal(test::Case c) {
  try {
    make_executor({{c.problem.get(), &c.state}}, executor_options({}));
  } catch (const DeviceError& error) {
    return error.what();
  }
  return "nothing was thrown";
}

TEST(SolverNoDevice, SaysSo) {
  ASSERT_TRUE(kHidden);
  for (Formulation formulation : {Formulation::frames, Formulation::spline})
    EXPECT_EQ(refusal(test::make_flight(formulation)), "no CUDA device: " + unavailable_reason());
}

}  // namespace
}  // namespace trajopt::cuda
