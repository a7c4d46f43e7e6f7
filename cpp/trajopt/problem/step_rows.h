// Steps of the unknowns, node by node: right-hand sides of the KKT system, what a step promises,
// and where it leads.
//
// A vector of the KKT system holds for node i the multipliers and then the tangent. The two steps
// of an iteration are solved for together, as columns: the tangential step t (A t = 0) and the
// normal step n (A n = -C).
#pragma once

#include "trajopt/base/reduction.h"
#include "trajopt/model/integrate.h"

namespace trajopt {

struct StepRows {
  int nodes, primal, dual;
  bool ring;
  double smoothing;
  const double* gradient;    // nodes x primal, at the current point
  const double* constraint;  // nodes x dual
  double* steps;             // nodes x (dual + primal) x 2: t, n
};

// What a node adds to the numbers that steer an iteration; W is the metric, y the multipliers.
enum StepItem : int {
  kTangentialNorm2,  // t.W t
  kMixedNorm2,       // t.W n
  kNormalNorm2,      // n.W n
  kTangentialSlope,  // g.t
  kNormalSlope,      // g.n
  kNormalCurvature,  // y_n.C: n.H n, because H n + A^T y_n = 0 and A n = -C
  kConstraint2,      // C.C
  kMultiplier,       // |y_t + y_n|_inf: folded with Largest, all others with Sum
  kStepItems
};

inline namespace TRAJOPT_ISA {

TRAJOPT_HD inline void write_steps_rhs(const StepRows& s, long i) {
  double* out = s.steps + i * (s.primal + s.dual) * 2;
  for (int k = 0; k < s.dual; ++k) {
    out[2 * k] = 0.0;
    out[2 * k + 1] = -s.constraint[i * s.dual + k];
  }
  out += 2 * s.dual;
  for (int k = 0; k < s.primal; ++k) {
    out[2 * k] = -s.gradient[i * s.primal + k];
    out[2 * k + 1] = 0.0;
  }
}

// The tangent part of node i - back of a KKT vector with `stride` columns; nullptr before node 0.
TRAJOPT_HD inline const double* tangent_back(const double* x, int nodes, int primal, int dual,
                                             bool ring, int stride, long i, int back) {
  long j = i - back;
  if (j < 0) {
    if (!ring) return nullptr;
    j += nodes;
  }
  return x + (j * (primal + dual) + dual) * stride;
}

// Component k of row i of D2 x: x_i - 2 x_{i-1} + x_{i-2}, what lies before node 0 does not move.
TRAJOPT_HD inline double second_difference(const double* const x[3], long k) {
  double e = x[0][k];
  if (x[1] != nullptr) e = fma(-2.0, x[1][k], e);
  if (x[2] != nullptr) e += x[2][k];
  return e;
}

// Writes item j of node i to items[j * stride + i].
TRAJOPT_HD inline void measure_steps(const StepRows& s, long i, double* items, long stride) {
  double v[kStepItems] = {};
  const double* y = s.steps + i * (s.primal + s.dual) * 2;
  for (int k = 0; k < s.dual; ++k) {
    const double c = s.constraint[i * s.dual + k];
    v[kNormalCurvature] = fma(y[2 * k + 1], c, v[kNormalCurvature]);
    v[kConstraint2] = fma(c, c, v[kConstraint2]);
    v[kMultiplier] = Largest{}(v[kMultiplier], magnitude(y[2 * k] + y[2 * k + 1]));
  }
  const double* x[3];
  for (int back = 0; back < 3; ++back)
    x[back] = tangent_back(s.steps, s.nodes, s.primal, s.dual, s.ring, 2, i, back);
  double bend[3] = {0.0, 0.0, 0.0};
  for (int k = 0; k < s.primal; ++k) {
    const double t = x[0][2 * k], n = x[0][2 * k + 1], g = s.gradient[i * s.primal + k];
    v[kTangentialNorm2] = fma(t, t, v[kTangentialNorm2]);
    v[kMixedNorm2] = fma(t, n, v[kMixedNorm2]);
    v[kNormalNorm2] = fma(n, n, v[kNormalNorm2]);
    v[kTangentialSlope] = fma(g, t, v[kTangentialSlope]);
    v[kNormalSlope] = fma(g, n, v[kNormalSlope]);
    const double bt = second_difference(x, 2 * k), bn = second_difference(x, 2 * k + 1);
    bend[0] = fma(bt, bt, bend[0]);
    bend[1] = fma(bt, bn, bend[1]);
    bend[2] = fma(bn, bn, bend[2]);
  }
  for (int j = 0; j < 3; ++j) v[j] = fma(s.smoothing, bend[j], v[j]);
  for (int j = 0; j < kStepItems; ++j) items[j * stride + i] = v[j];
}

// step_i = c_t t + c_n n, the tangent alone.
TRAJOPT_HD inline void compose_step(const StepRows& s, long i, double ct, double cn, double* step) {
  const double* x = s.steps + (i * (s.primal + s.dual) + s.dual) * 2;
  for (int k = 0; k < s.primal; ++k) step[i * s.primal + k] = fma(ct, x[2 * k], cn * x[2 * k + 1]);
}

// Right-hand side of a second-order correction of a step d with A d = -zeta C: the constraint at
// the trial point is to become what the linear model promised, (1 - zeta) C.
TRAJOPT_HD inline void write_correction_rhs(const StepRows& s, long i, double zeta,
                                            const double* trial_constraint, double* rhs) {
  double* out = rhs + i * (s.primal + s.dual);
  for (int k = 0; k < s.dual; ++k) {
    const long c = i * s.dual + k;
    out[k] = -(trial_constraint[c] - (1 - zeta) * s.constraint[c]);
  }
  for (int k = 0; k < s.primal; ++k) out[s.dual + k] = 0.0;
}

TRAJOPT_HD inline void add_correction(const StepRows& s, long i, const double* correction,
                                      const double* step, double* corrected) {
  const double* x = correction + i * (s.primal + s.dual) + s.dual;
  for (int k = 0; k < s.primal; ++k) corrected[i * s.primal + k] = step[i * s.primal + k] + x[k];
}

// Gradient by frame i (0-based): its share of windows i, i+1, i+2. gradient: N x 3 x D.
TRAJOPT_HD inline void gather_gradient(const double* gradient, long frames, int d, bool ring,
                                       long i, double* out) {
  for (int k = 0; k < d; ++k) out[k] = gradient[i * 3 * d + k];
  for (int q = 1; q < 3; ++q) {
    long f = i + q;
    if (f >= frames) {
      if (!ring) break;
      f -= frames;
    }
    const double* window = gradient + (f * 3 + q) * d;
    for (int k = 0; k < d; ++k) out[k] += window[k];
  }
}

}  // namespace TRAJOPT_ISA
}  // namespace trajopt
