// What a control point gathers from the frames that hang on it: Pan's reduced constraint, and the
// gradient. Node z is the unknown control point z + 1, where segment z ends and segment z + 1
// begins; sums go over the frames of both in ascending order.
#pragma once

#include "trajopt/model/integrate.h"
#include "trajopt/trajectory/hermite_body.h"

namespace trajopt::inline TRAJOPT_ISA {

// The frames [begin, end) of a node.
struct NodeFrames {
  long begin, end;
  TRAJOPT_HD NodeFrames(const SplineView& s, long node)
      : begin(node * s.per_segment), end(begin + 2L * s.per_segment) {
    const long frames = static_cast<long>(s.segments) * s.per_segment;
    if (end > frames) end = frames;
  }
};

// Which of a frame's halves belongs to a half (0: configuration, 1: velocity) of one of its nodes.
TRAJOPT_HD inline int half_of(const SplineView& s, long frame, long node, int half) {
  return (frame / s.per_segment == node ? 2 : 0) + half;
}

// out (2 x m): C of a node, S^T times the constraints (N x m) of the frames.
TRAJOPT_HD inline void reduce_constraint(const SplineView& s, int m, const double* constraint,
                                         long node, double* out) {
  const NodeFrames frames(s, node);
  for (int half = 0; half < 2; ++half) {
    for (int r = 0; r < m; ++r) {
      double sum = 0.0;
      for (long f = frames.begin; f < frames.end; ++f)
        sum = fma(s.weight(f, half_of(s, f, node, half)), constraint[f * m + r], sum);
      out[half * m + r] = sum;
    }
  }
}

// out (2 x D): the gradient by a node, from that by the frames (N x D).
TRAJOPT_HD inline void reduce_gradient(const SplineView& s, int d, const double* gradient,
                                       long node, double* out) {
  const NodeFrames frames(s, node);
  for (int half = 0; half < 2; ++half) {
    for (int run = 0; run < s.nruns; ++run) {
      const DofRun& dofs = s.runs[run];
      for (int k = 0; k < dofs.count; ++k) {
        double sum = 0.0;
        for (long f = frames.begin; f < frames.end; ++f) {
          const int h = half_of(s, f, node, half);
          const double* g = gradient + f * d + dofs.first;
          if (dofs.ball < 0) {
            sum = fma(s.weight(f, h), g[k], sum);
          } else {
            const double* t = s.rotation(f, h, dofs.ball);
            for (int b = 0; b < 3; ++b) sum = fma(t[3 * b + k], g[b], sum);
          }
        }
        out[half * d + dofs.first + k] = sum;
      }
    }
  }
}

// The step from `from` to `to`, both Z x nq configurations and then Z x D velocities, of a node.
TRAJOPT_HD inline void retract_control_point(const ModelView& model, const SplineView& s,
                                             const double* from, const double* step, long node,
                                             double* to) {
  const long nq = model.nq, d = model.ndof, velocity = s.segments * nq + node * d;
  integrate_body(model, from + node * nq, step + node * 2 * d, to + node * nq);
  for (long k = 0; k < d; ++k) to[velocity + k] = from[velocity + k] + step[node * 2 * d + d + k];
}

TRAJOPT_HD inline void accept_control_point(const ModelView& model, const SplineView& s,
                                            const double* from, long node, double* to) {
  const long nq = model.nq, d = model.ndof, velocity = s.segments * nq + node * d;
  for (long k = node * nq; k < (node + 1) * nq; ++k) to[k] = from[k];
  for (long k = velocity; k < velocity + d; ++k) to[k] = from[k];
}

}  // namespace trajopt::inline TRAJOPT_ISA
