// The executor of the default solver on a GPU. Plain C++: this header needs no nvcc.
#pragma once

#include <memory>
#include <vector>

#include "trajopt/solver/executor.h"

namespace trajopt::cuda {

// For problems of one shape; with the bits of the processor's executor for the same elimination
// order. Ordering::automatic is cyclic reduction here, or two sweeps where there are enough
// problems to fill the device. Moves the members' states, which are up to date whenever state() has
// been called. Throws DeviceError where there is no device and for a problem it does not support,
// DeviceMemoryError where the device's memory does not suffice.
std::unique_ptr<BatchExecutor> make_executor(const std::vector<BatchMember>& members,
                                             const ExecutorOptions& options);

}  // namespace trajopt::cuda
