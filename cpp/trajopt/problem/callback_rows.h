// What a term that was evaluated elsewhere (CallbackObjective) adds to a frame: its cost, and the
// Gauss-Newton Hessian and gradient of the window.
#pragma once

#include "trajopt/problem/frame_kernels.h"
#include "trajopt/problem/kkt_rows.h"

namespace trajopt {

struct CallbackRows {
  int rows;
  double weight;
  const double* residual;  // of a frame: rows
  const double* jacobian;  // rows x 3D
};

inline namespace TRAJOPT_ISA {

TRAJOPT_HD inline double callback_cost(const CallbackRows& t) {
  double cost = 0.0;
  for (int row = 0; row < t.rows; ++row) cost += t.weight * t.residual[row] * t.residual[row];
  return cost;
}

// hessian: 6 x D x D, gradient: 3 x D, of the frame.
template <class Group>
TRAJOPT_HD inline void add_callback_rows(const Group& group, const CallbackRows& t, int d,
                                         double* hessian, double* gradient) {
  const double c = 2 * t.weight;
  for (int row = 0; row < t.rows; ++row) {
    const double* j = t.jacobian + static_cast<long>(row) * 3 * d;
    const double r = t.residual[row];
    for_each(group, 3 * d, [&](int i) { gradient[i] += c * j[i] * r; });
    for (int b = 0; b < 6; ++b) {
      double* h = hessian + static_cast<long>(b) * d * d;
      const double *ja = j + kWindowBlocks[b][0] * d, *jb = j + kWindowBlocks[b][1] * d;
      for_entries(group, d, d, [&](int i, int k) { h[i * d + k] += c * ja[i] * jb[k]; });
    }
  }
}

}  // namespace TRAJOPT_ISA
}  // namespace trajopt
