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

std::string refusal(Formulation formulation) {
  test::Case c = test::make_flight(formulation);
  try {
    make_executor({{c.problem.get(), &c.state}}, executor_options({}));
  } catch (const DeviceError& error) {
    return error.what();
  }
  return "nothing was thrown";
}

TEST(SolverNoDevice, SaysSo) {
  ASSERT_TRUE(kHidden);
  EXPECT_EQ(refusal(Formulation::frames), "no CUDA device: " + unavailable_reason());
}

TEST(SolverNoDevice, WhatIsNotSupportedComesFirst) {
  EXPECT_NE(refusal(Formulation::spline).find("spline"), std::string::npos);
}

}  // namespace
}  // namespace trajopt::cuda
