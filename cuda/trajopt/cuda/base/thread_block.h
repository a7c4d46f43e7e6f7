// The group of trajopt/base/group.h that a CUDA thread block forms.
#pragma once

#include "trajopt/base/hd.h"

namespace trajopt::cuda {

// __host__ too only because the algorithms are; a host has no thread block and never calls it.
class ThreadBlock {
 public:
  template <class T>
  class Local {  // registers of the thread
   public:
    TRAJOPT_HD explicit Local(const ThreadBlock&) {}
    TRAJOPT_HD T& operator[](int) { return value_; }

   private:
    T value_;
  };

#ifdef __CUDA_ARCH__
  __device__ int size() const { return static_cast<int>(blockDim.x); }
  template <class Body>
  __device__ void phase(const Body& body) const {
    body(static_cast<int>(threadIdx.x));
    __syncthreads();
  }
#else
  TRAJOPT_HD int size() const { return 0; }
  template <class Body>
  TRAJOPT_HD void phase(const Body&) const {}
#endif
};

}  // namespace trajopt::cuda
