#include "trajopt/problem/spline_kernels.h"

namespace trajopt {
inline namespace TRAJOPT_ISA {
namespace {

void retract(const ModelView& model, const SplineView& s, const double* from, const double* step,
             long node, double* to) {
  retract_control_point(model, s, from, step, node, to);
}

void constraint_of(const SplineView& s, int m, const double* constraint, long node, double* out) {
  reduce_constraint(s, m, constraint, node, out + node * 2 * m);
}

void gradient_of(const SplineView& s, int d, const double* gradient, long node, double* out) {
  reduce_gradient(s, d, gradient, node, out + node * 2 * d);
}

void block_row(const SplineRows& rows, long g, double* scratch) {
  write_spline_block_row(Serial{}, rows, g, scratch);
}

}  // namespace

extern const SplineKernels kSplineKernels;
const SplineKernels kSplineKernels{retract, constraint_of, gradient_of, block_row};

}  // namespace TRAJOPT_ISA
}  // namespace trajopt
