// Factors of a batch in scalar type T, in device memory.
#pragma once

#include "trajopt/cuda/base/buffer.h"
#include "trajopt/linalg/group_system.h"

namespace trajopt::cuda {

template <class T>
class Factors {
 public:
  Factors() = default;
  // stage_w: solve with a copy of W in shared memory.
  Factors(const linalg::GroupPlan& plan, int blocks, int size, int batch, bool stage_w) {
    system_.slots = plan.slots;
    system_.runs = plan.runs;
    system_.ld = linalg::group_ld<T>(size);
    system_.stage_w = stage_w;
    const std::size_t items = batch, block = system_.ld * size;
    w_ = DeviceBuffer<T>(items * blocks * block);
    couplings_ = DeviceBuffer<T>(items * plan.slots * block);
    inverse_ = DeviceBuffer<T>(items * blocks * size);
    scratch_ = DeviceBuffer<T>(items * plan.runs * 3 * block);
    system_.w = w_.data();
    system_.couplings = couplings_.data();
    system_.inverse = inverse_.data();
    system_.scratch = scratch_.data();
  }

  // With the matrices `a`; where failures go is left to the caller.
  linalg::BasicGroupSystem<T> system(const linalg::GroupMatrix& a) const {
    linalg::BasicGroupSystem<T> s = system_;
    static_cast<linalg::GroupMatrix&>(s) = a;
    return s;
  }

  std::size_t bytes() const {
    return w_.bytes() + couplings_.bytes() + inverse_.bytes() + scratch_.bytes();
  }

 private:
  linalg::BasicGroupSystem<T> system_;
  DeviceBuffer<T> w_, couplings_, inverse_, scratch_;
};

}  // namespace trajopt::cuda
