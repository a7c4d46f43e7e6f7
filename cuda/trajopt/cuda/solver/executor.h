// The executor of the default solver on a GPU. Plain C++: this header needs no nvcc.
#pragma once

#include <memory>

#include "trajopt/solver/executor.h"

namespace trajopt::cuda {

// For the frames formulation; with the bits of the processor's executor for the same elimination
// order. Ordering::automatic is cyclic reduction here. Moves `state`, which is up to date whenever
// state() has been called. Throws DeviceError where there is no device, where its memory does not
// suffice, and for a problem it does not support.
std::unique_ptr<SqpExecutor> make_executor(const TrajectoryProblem& problem,
                                           const ExecutorOptions& options, State& state);

}  // namespace trajopt::cuda
