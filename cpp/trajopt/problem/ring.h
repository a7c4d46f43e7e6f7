// A motion that repeats itself, further on by a stride.
#pragma once

#include "trajopt/base/hd.h"
#include "trajopt/model/model.h"

namespace trajopt::inline TRAJOPT_ISA {

// `to`: a configuration one period before `from`. The stride moves the leading slides of the root.
TRAJOPT_HD inline void one_period_before(const ModelView& model, const double* stride,
                                         const double* from, double* to) {
  for (int k = 0; k < model.nq; ++k) to[k] = from[k];
  for (int j = 0; j < model.njoint && j < 3; ++j) {
    if (model.joints[j].type != JointType::slide) break;
    to[model.joints[j].q] -= stride[j];
  }
}

}  // namespace trajopt::inline TRAJOPT_ISA
