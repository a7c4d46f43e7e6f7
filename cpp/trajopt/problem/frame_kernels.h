// The hot loop: dynamics and objective rows of W frames at a time, one frame per SIMD lane.
//
// For frame i with nodes x_i, x_{i-1}, x_{i-2} a linearization gives, over the window of the three:
// the constraint (unactuated rows of FD) with its Jacobian, and the Gauss-Newton Hessian J^T J and
// gradient J^T r of all dense rows. Rows carry sqrt(2 weight), so the cost is sum r^2 / 2.
#pragma once

#include <cstddef>

#include "trajopt/force/physics.h"
#include "trajopt/model/model.h"

namespace trajopt {

enum class DenseKind : int {
  center_of_mass_velocity,  // (c_i - c_{i-1})/dt - target          Pan eq. 17
  center_of_mass_position,  // c_i - target                         Pan eq. 18
  effort,                   // u = actuated rows of FD
  physics,                  // unactuated rows of FD, as a penalty beside the constraint
  point_position,           // P(x_i) - target
  point_velocity,           // (P(x_i) - P(x_{i-1}))/dt - target
  contact_rate,             // (F_i - F_{i-1})/dt of every contact point
  contact_slip,             // sqrt(w_n) d v_t of every contact point
  contact_impact            // sqrt(w_n) d v_n of every contact point, d before and after the step
};

struct DenseTerm {
  DenseKind kind;
  int joint = 0;  // of the point
  double point[3] = {0, 0, 0};
  double axes[3] = {1, 1, 1};      // multiplies the three rows
  const double* scale = nullptr;   // N: sqrt(2 weight_i); 0 switches the frame off
  const double* target = nullptr;  // N x 3
};

// Rows a term has at most; the contact terms leave out points that touch nothing.
TRAJOPT_HD inline int rows_of(DenseKind kind, const ModelView& model) {
  if (kind == DenseKind::contact_rate || kind == DenseKind::contact_slip) return 3 * model.npoint;
  if (kind == DenseKind::contact_impact) return 2 * model.npoint;
  if (kind == DenseKind::effort) return model.nactuated;
  return kind == DenseKind::physics ? model.nunactuated : 3;
}

struct FrameInput {
  ModelView model;
  const Physics* physics;
  const Stencil* stencils;  // N
  const double* dt;         // N + 1: t_i - t_{i-1} for i = 0..N
  const double* frames;     // (N + 2) x nq: x_{-1}, x_0, ..., x_N
  const DenseTerm* terms;
  int nterm;
  double augmentation;  // adds this times A^T A to the Hessian
};

// The six blocks of the window's upper triangle, in the order they are stored.
TRAJOPT_TABLE int kWindowBlocks[6][2] = {{0, 0}, {0, 1}, {0, 2}, {1, 1}, {1, 2}, {2, 2}};

struct FrameOutput {   // for frame i = 1..N at index i - 1
  double* constraint;  // N x m
  double* torque;      // N x nu
  double* cost;        // N x nterm
  double* hessian;     // N x 6 x D x D
  double* gradient;    // N x 3 x D
  double* jacobian;    // N x 3 x m x D
};

struct FrameKernels {
  int lanes;
  std::size_t (*scratch_bytes)(const FrameInput&);
  // Frames [begin, begin + count), count <= lanes.
  void (*evaluate)(const FrameInput&, long begin, int count, void* scratch, const FrameOutput&);
  void (*linearize)(const FrameInput&, long begin, int count, void* scratch, const FrameOutput&);
};

const FrameKernels& frame_kernels();  // for the active instruction set

}  // namespace trajopt
