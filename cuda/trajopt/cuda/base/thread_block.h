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
  __device__ void lower(int* where, int value) const { atomicMin(where, value); }
  // The bits of doubles that are not negative are ordered like the doubles, NaN above all.
  __device__ void raise(double* where, double value) const {
    atomicMax(reinterpret_cast<unsigned long long*>(where),
              static_cast<unsigned long long>(__double_as_longlong(value)));
  }
#else
  TRAJOPT_HD int size() const { return 0; }
  template <class Body>
  TRAJOPT_HD void phase(const Body&) const {}
  TRAJOPT_HD void lower(int*, int) const {}
  TRAJOPT_HD void raise(double*, double) const {}
#endif
};

}  // namespace trajopt::cuda
