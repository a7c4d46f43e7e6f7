// q (+) step: moves a configuration along a tangent step.
#pragma once

#include "trajopt/model/model.h"
#include "trajopt/model/rotation.h"

namespace trajopt::inline TRAJOPT_ISA {

TRAJOPT_HD inline void integrate_joint(const Joint& joint, const double* q, const double* step,
                                       double* out) {
  if (joint.type == JointType::ball) {
    double turn[4];
    quaternion_exp({step[joint.dof], step[joint.dof + 1], step[joint.dof + 2]}, turn);
    quaternion_product(turn, q + joint.q, out + joint.q);
  } else {
    out[joint.q] = q[joint.q] + step[joint.dof];
  }
}

TRAJOPT_HD inline void integrate_body(const ModelView& model, const double* q, const double* step,
                                      double* out) {
  for (int j = 0; j < model.njoint; ++j) integrate_joint(model.joints[j], q, step, out);
}

}  // namespace trajopt::inline TRAJOPT_ISA
