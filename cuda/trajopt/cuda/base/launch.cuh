// Launches of work as trajopt/linalg/group_work.h describes it: a type with jobs(), ranks(),
// bytes(), kMaxRanks, kName and operator()(group, job, space).
#pragma once

#include <algorithm>

#include "trajopt/cuda/base/check.h"
#include "trajopt/cuda/base/stream.h"
#include "trajopt/cuda/base/thread_block.h"

namespace trajopt::cuda {

// One thread block per job, or each several in turn where a grid cannot have that many.
template <class Work>
__global__ void __launch_bounds__(Work::kMaxRanks) run(const __grid_constant__ Work work) {
  extern __shared__ __align__(16) unsigned char space[];
  const ThreadBlock group;
  const long jobs = work.jobs();
  for (long job = blockIdx.x; job < jobs; job += gridDim.x) {
    work(group, job, space);
    __syncthreads();  // the next job reuses the space
  }
}

// Loads the kernel, which must not happen while a graph is captured.
template <class Work>
void load() {
  cudaFuncAttributes attributes;
  check(cudaFuncGetAttributes(&attributes, run<Work>), Work::kName);
}

inline constexpr std::size_t kFreeSharedMemory = 48 << 10;  // a kernel gets without asking

// Lets a kernel use all shared memory that a thread block can have.
template <class Kernel>
void allow_shared_memory(Kernel* kernel) {
  int device = 0, most = 0;
  TRAJOPT_CUDA_CHECK(cudaGetDevice(&device));
  TRAJOPT_CUDA_CHECK(
      cudaDeviceGetAttribute(&most, cudaDevAttrMaxSharedMemoryPerBlockOptin, device));
  TRAJOPT_CUDA_CHECK(
      cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, most));
}

template <class Work>
void launch(const Work& work, const Stream& stream) {
  constexpr long kMostBlocks = 0x7fffffff;
  const long jobs = work.jobs();
  if (jobs == 0) return;
  const std::size_t bytes = work.bytes();
  if (bytes > kFreeSharedMemory) allow_shared_memory(run<Work>);
  const unsigned blocks = static_cast<unsigned>(std::min(jobs, kMostBlocks));
  run<Work><<<blocks, work.ranks(), bytes, stream.get()>>>(work);
  check_launch(Work::kName);
}

}  // namespace trajopt::cuda
