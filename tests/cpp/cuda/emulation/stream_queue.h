// The part of the emulated CUDA runtime that emulated launches need.
#pragma once

#include <cuda_runtime_api.h>

#include <cstddef>
#include <functional>

namespace trajopt::emulation {

// Work of a stream: done when the stream is synchronized, or recorded while it is captured.
void enqueue(cudaStream_t stream, std::function<void()> work);

// Memory of the device, and how much of it is taken [bytes].
void set_memory(std::size_t bytes);
std::size_t allocated_memory();

}  // namespace trajopt::emulation
