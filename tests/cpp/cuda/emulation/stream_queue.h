// The part of the emulated CUDA runtime that emulated launches need.
#pragma once

#include <cuda_runtime_api.h>

#include <functional>

namespace trajopt::emulation {

// Work of a stream: done when the stream is synchronized, or recorded while it is captured.
void enqueue(cudaStream_t stream, std::function<void()> work);

}  // namespace trajopt::emulation
