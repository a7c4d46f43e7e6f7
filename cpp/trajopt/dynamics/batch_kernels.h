// The dynamics of W frames at a time in the chart users see, compiled once per instruction set.
#pragma once

#include <cstddef>

#include "trajopt/dynamics/batch.h"

namespace trajopt {

struct BatchKernels {
  int lanes;
  std::size_t (*scratch_bytes)(const ModelView&);
  // Frames [begin, begin + count), count <= lanes; residual only, or with all three Jacobians.
  void (*run)(const ModelView&, const Physics&, const DynamicsBatch&, long begin, int count,
              void* scratch);
};

const BatchKernels& batch_kernels();  // for the active instruction set

}  // namespace trajopt
