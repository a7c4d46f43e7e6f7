#include "trajopt/problem/node_kernels.h"

namespace trajopt {
inline namespace TRAJOPT_ISA {
namespace {

void local_term(const FrameInput& in, const LocalTerm& term, long begin, long end, double* hessian,
                double* gradient, double* cost) {
  const long d = in.model.ndof;
  for (long f = begin; f < end; ++f) {
    const LocalFrame frame = local_frame(in, f);
    cost[f] = hessian == nullptr
                  ? add_local_term<false>(in.model, term, frame, nullptr, nullptr)
                  : add_local_term<true>(in.model, term, frame, hessian + f * 6 * d * d,
                                         gradient + f * 3 * d);
  }
}

void gather_gradients(const double* gradient, long frames, int d, bool ring, long begin, long end,
                      double* out) {
  for (long i = begin; i < end; ++i) gather_gradient(gradient, frames, d, ring, i, out + i * d);
}

void retract(const ModelView& model, long begin, long end, const double* q, const double* step,
             long stride, double* out) {
  for (long i = begin; i < end; ++i)
    integrate_body(model, q + i * model.nq, step + i * stride, out + i * model.nq);
}

void block_row(const KktRows& rows, long g) { write_block_row(Serial{}, rows, g); }

void steps_rhs(const StepRows& s, long begin, long end) {
  for (long i = begin; i < end; ++i) write_steps_rhs(s, i);
}

void measure(const StepRows& s, long begin, long end, double* items, long stride) {
  for (long i = begin; i < end; ++i) measure_steps(s, i, items, stride);
}

void compose(const StepRows& s, long begin, long end, double ct, double cn, double* step) {
  for (long i = begin; i < end; ++i) compose_step(s, i, ct, cn, step);
}

void correction_rhs(const StepRows& s, long begin, long end, double zeta,
                    const double* trial_constraint, double* rhs) {
  for (long i = begin; i < end; ++i) write_correction_rhs(s, i, zeta, trial_constraint, rhs);
}

void correct(const StepRows& s, long begin, long end, const double* correction, const double* step,
             double* corrected) {
  for (long i = begin; i < end; ++i) add_correction(s, i, correction, step, corrected);
}

}  // namespace

extern const NodeKernels kNodeKernels;
const NodeKernels kNodeKernels{local_term, gather_gradients, retract,        block_row, steps_rhs,
                               measure,    compose,          correction_rhs, correct};

}  // namespace TRAJOPT_ISA
}  // namespace trajopt
