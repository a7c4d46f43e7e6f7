// What an iteration does per node or block row besides dynamics and linear algebra, compiled for
// each instruction set. The bodies are those of local_terms.h, kkt_rows.h and step_rows.h, which a
// GPU runs as well.
#pragma once

#include "trajopt/problem/kkt_rows.h"
#include "trajopt/problem/local_terms.h"
#include "trajopt/problem/step_rows.h"

namespace trajopt {

struct NodeKernels {  // ranges are [begin, end)
  // cost[f] of a term for a range of frames; with hessian (N x 6 x D x D) also adds derivatives.
  void (*local_term)(const FrameInput& in, const LocalTerm& term, long begin, long end,
                     double* hessian, double* gradient, double* cost);
  void (*gather_gradient)(const double* gradient, long frames, int d, bool ring, long begin,
                          long end, double* out);
  // Steps and configurations of node i at step + i * stride and q + i * nq.
  void (*retract)(const ModelView& model, long begin, long end, const double* q, const double* step,
                  long stride, double* out);
  void (*write_block_row)(const KktRows& rows, long g);
  void (*write_steps_rhs)(const StepRows& s, long begin, long end);
  void (*measure_steps)(const StepRows& s, long begin, long end, double* items, long stride);
  void (*compose_step)(const StepRows& s, long begin, long end, double ct, double cn, double* step);
  void (*write_correction_rhs)(const StepRows& s, long begin, long end, double zeta,
                               const double* trial_constraint, double* rhs);
  void (*add_correction)(const StepRows& s, long begin, long end, const double* correction,
                         const double* step, double* corrected);
};

const NodeKernels& node_kernels();  // for the active instruction set

}  // namespace trajopt
