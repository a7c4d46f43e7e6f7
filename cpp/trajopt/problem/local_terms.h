// Joint-by-joint objective terms: value, and contribution to a frame's window.
#pragma once

#include "trajopt/model/model.h"
#include "trajopt/problem/objective.h"

namespace trajopt {

// Frame f (0-based) with nodes q0 = x_i, q1 = x_{i-1}, q2 = x_{i-2} and steps dt, dt_before.
struct LocalFrame {
  long index;
  const double* q[3];
  double dt, dt_before;
};

// weight * |r|^2. With hessian and gradient (a window: 6 x D x D blocks, 3 x D) adds 2 w J^T J and
// 2 w J^T r to them.
double add_local_term(const Model& model, const LocalObjective& term, const LocalFrame& frame,
                      double* hessian, double* gradient);

}  // namespace trajopt
