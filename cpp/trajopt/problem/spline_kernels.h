// What an iteration does per control point or block row of the spline, compiled for each
// instruction set. The bodies are those of spline_rows.h and spline_block_row.h, which a GPU runs
// as well.
#pragma once

#include "trajopt/problem/spline_block_row.h"
#include "trajopt/problem/spline_rows.h"

namespace trajopt {

struct SplineKernels {
  // from, to: states; step: Z x 2D.
  void (*retract)(const ModelView& model, const SplineView& s, const double* from,
                  const double* step, long node, double* to);
  // constraint: N x m, gradient: N x D, both by frame. out: Z x 2m, Z x 2D, of which the kernel
  // writes one node.
  void (*reduce_constraint)(const SplineView& s, int m, const double* constraint, long node,
                            double* out);
  void (*reduce_gradient)(const SplineView& s, int d, const double* gradient, long node,
                          double* out);
  // scratch: spline_row_scratch(D) doubles.
  void (*write_block_row)(const SplineRows& rows, long g, double* scratch);
};

const SplineKernels& spline_kernels();  // for the active instruction set

}  // namespace trajopt
