// Batches of independent frames in the chart users see: x holds rotation vectors.
#pragma once

#include "trajopt/force/physics.h"
#include "trajopt/model/model.h"

namespace trajopt {

// All arrays have a leading axis of `count` frames; jacobians may be null (residual only).
struct DynamicsBatch {
  long count;
  const double* x;                                     // count x D: frame i
  const double* x1;                                    // frame i-1
  const double* x2;                                    // frame i-2
  const double* dt;                                    // count: t_i - t_{i-1}
  const double* dt_before;                             // count: t_{i-1} - t_{i-2}
  double* fd;                                          // count x D
  double* jacobians[3] = {nullptr, nullptr, nullptr};  // each count x D x D
};

void dynamics_batch(const Model& model, const Physics& physics, const DynamicsBatch& batch,
                    int threads);

// Joint frames as 3x4 [R t], count x J x 12.
void kinematics_batch(const Model& model, long count, const double* x, double* transforms);

// count x 3
void center_of_mass_batch(const Model& model, long count, const double* x, double* com);

// Force on every contact point, count x P x 3, for given centre velocities count x P x 3.
void contact_forces_batch(const Model& model, const Physics& physics, long count, const double* x,
                          const double* velocity, double* forces);

}  // namespace trajopt
