// The KKT matrix of the frames formulation by nodes, half of it: the rows of node i with the nodes
// before it and, as a lower triangle, with itself.
//
//            x_{i-2}    x_{i-1}    y_i      x_i           y: multipliers, x: tangent
//   y_i      A_{i,i-2}  A_{i,i-1}  0                      A: Jacobian of the constraints
//   x_i      H_{i,i-2}  H_{i,i-1}  A_ii^T   H_ii          H: Gauss-Newton Hessian
//
// A linearization leaves them: 3 D^2 + 3 m D numbers a node, half of what the frames' windows hold.
// What damps the Hessian is added to its diagonals where they are used.
#pragma once

#include "trajopt/base/isa.h"

namespace trajopt {

struct NodeRows {
  static constexpr int kSpillBlocks = 4;

  int nodes, primal, dual;
  double smoothing, damping;
  const double* data;  // nodes x width x columns

  int width() const { return primal + dual; }
  int kept() const { return 2 * primal; }  // columns of the nodes before
  int columns() const { return kept() + width(); }
  long length() const { return static_cast<long>(width()) * columns(); }
  long at(long node, int r) const { return node * length() + static_cast<long>(r) * columns(); }
  const double* row(long node, int r) const { return data + at(node, r); }
};

struct NodeRowKernels {
  // Writes the rows of nodes [begin, end): what the windows (6 x D x D, in the order of
  // kWindowBlocks) and Jacobians (3 x m x D) of a chunk of frames [begin, end) add up to. Shares of
  // nodes before the chunk, which belong to others, go to `spill`: kSpillBlocks x D x D.
  void (*add_windows)(const NodeRows& s, long begin, long end, const double* windows,
                      const double* jacobians, double* rows, double* spill);
  // What the chunk of frames from `first` on has for the nodes before it.
  void (*add_spill)(const NodeRows& s, long first, const double* spill, double* rows);

  // The lower triangle of node i by itself, damped.
  void (*write_pivots)(const NodeRows& s, int i, double* p, long ld);
  // Node i by the nodes i-2 and i-1, tangents only; and by the nodes i+2 and i+1, multipliers
  // first: then nothing of y_i.
  void (*write_couplings_before)(const NodeRows& s, int i, double* c, long ld);
  void (*write_couplings_behind)(const NodeRows& s, int i, double* c, long ld);

  // Schur complements of two nodes that stay, `half` rows each, far one first, lower triangles.
  // What the front before left for its near node, to the rows of p and columns of c from `first`
  // and `half` on; and the start of the next one, whose near node is the far one of `before`.
  void (*add_schur)(const double* before, long schur_ld, int half, int first, double* p, double* c,
                    long ld);
  void (*start_schur)(const double* before, long schur_ld, int half, double* next);

  // r_i -= damping (W x)_i for node i, m columns.
  void (*subtract_damping)(const NodeRows& s, long i, const double* x, double* r, int m);
};

// Of an instruction set, or of the best one below it that is active.
const NodeRowKernels& node_row_kernels(Isa isa);

}  // namespace trajopt
