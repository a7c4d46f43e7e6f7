// Every CUDA call is checked, and what fails becomes a trajopt::DeviceError that names the call and
// the device.
#pragma once

#include <cuda_runtime_api.h>

#include <cstddef>

#include "trajopt/base/error.h"

namespace trajopt::cuda {

// Throws unless `status` is cudaSuccess. `call` is the call as it stands in the source.
void check(cudaError_t status, const char* call);

// The same after the launch of a kernel: what is wrong with its arguments shows at once, what goes
// wrong while it runs shows in a later call.
void check_launch(const char* kernel);

// Of an allocation: also says how much was asked for and how much is free.
void check_allocation(cudaError_t status, const char* call, std::size_t bytes);

}  // namespace trajopt::cuda

#define TRAJOPT_CUDA_CHECK(call) ::trajopt::cuda::check((call), #call)
