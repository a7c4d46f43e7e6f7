// Cubic Hermite spline over configurations (Pan section 5.1), a frame at a time: where it lies, and
// how it hangs on the two control points around it. One body for every executor.
//
// Frame f (0-based: x_{f+1}) of segment s = f / L depends on four halves of control points, in this
// order: configuration and velocity of control point s, where the segment starts, and of s + 1,
// where it ends. Slides and hinges follow the cubic's weights. Balls are interpolated in a chart of
// their own per segment, the rotation vector relative to the start: R = exp(h) R_a with
//
//   h = h10 w_a + h01 phi + h11 J_l^-1(phi) w_b,   phi = log(R_b R_a^T),
//
// and their tangent follows a 3x3 matrix by each half.
#pragma once

#include "trajopt/model/model.h"
#include "trajopt/model/rotation.h"

namespace trajopt {

// Degrees of freedom in a row that a spline treats alike: slides and hinges, or those of a ball.
struct DofRun {
  int first, count;
  int ball;  // which one; -1: none
};

// The control points of a spline as they lie in memory. The first one is fixed.
struct ControlPoints {
  const double *first, *first_velocity;  // nq, D
  const double *others, *velocities;     // Z x nq, Z x D; velocities are dx/ds, s in [0, 1]
};

struct SplineView {
  int segments, per_segment;  // Z, L; 0: there is no spline
  int balls, nruns;
  const DofRun* runs;
  const double* weights;    // L x 4: of a segment's frames by each half
  const double* plain;      // L x 4 x D: the same for every dof, zero for those of balls
  const double* rotations;  // Z L x 4 x balls x 9, row-major: d(tangent of the frame)/d(half)

  TRAJOPT_HD double weight(long f, int half) const { return weights[f % per_segment * 4 + half]; }
  TRAJOPT_HD const double* plain_weights(long f, int half, int dofs) const {
    return plain + (f % per_segment * 4 + half) * dofs;
  }
  TRAJOPT_HD const double* rotation(long f, int half, int ball) const {
    return rotations + ((f * 4 + half) * balls + ball) * 9;
  }
};

inline namespace TRAJOPT_ISA {

// Weights of the four halves at s in [0, 1].
TRAJOPT_HD inline void hermite_weights(double s, double* weights) {
  const double s2 = s * s, s3 = s2 * s;
  weights[0] = 2 * s3 - 3 * s2 + 1;
  weights[1] = s3 - 2 * s2 + s;
  weights[2] = 3 * s2 - 2 * s3;
  weights[3] = s3 - s2;
}

// The two control points around a frame.
struct SplineEnds {
  const double *qa, *va, *qb, *vb;

  TRAJOPT_HD SplineEnds(const ModelView& m, const SplineView& spline, const ControlPoints& c,
                        long f) {
    const long z = f / spline.per_segment;
    qa = z == 0 ? c.first : c.others + (z - 1) * m.nq;
    va = z == 0 ? c.first_velocity : c.velocities + (z - 1) * m.ndof;
    qb = c.others + z * m.nq;
    vb = c.velocities + z * m.ndof;
  }
};

// A ball's part of a frame in the chart of its segment.
struct BallChart {
  Vec3<double> wb, phi, h;
  Mat3<double> inverse;  // J_l^-1(phi)

  TRAJOPT_HD BallChart(const Joint& joint, const SplineEnds& at, const double* weights) {
    const Vec3<double> wa = broadcast3<double>(at.va + joint.dof);
    wb = broadcast3<double>(at.vb + joint.dof);
    phi = quaternion_difference(at.qb + joint.q, at.qa + joint.q);
    inverse = left_jacobian_inverse(phi);
    h = weights[1] * wa + weights[2] * phi + weights[3] * (inverse * wb);
  }
};

// x: the configuration of frame f.
TRAJOPT_HD inline void hermite_frame(const ModelView& model, const SplineView& spline,
                                     const ControlPoints& c, long f, double* x) {
  const SplineEnds at(model, spline, c, f);
  const double* w = spline.weights + f % spline.per_segment * 4;
  for (int j = 0; j < model.njoint; ++j) {
    const Joint& joint = model.joints[j];
    const int q = joint.q, v = joint.dof;
    if (joint.type == JointType::ball) {
      double turn[4];
      quaternion_exp(BallChart(joint, at, w).h, turn);
      quaternion_product(turn, at.qa + q, x + q);
    } else {
      x[q] = w[0] * at.qa[q] + w[1] * at.va[v] + w[2] * at.qb[q] + w[3] * at.vb[v];
    }
  }
}

TRAJOPT_HD inline Mat3<double> scaled(double c, const Mat3<double>& a) {
  Mat3<double> r;
  for (int i = 0; i < 9; ++i) r.m[i] = c * a.m[i];
  return r;
}

TRAJOPT_HD inline Mat3<double> transpose(const Mat3<double>& a) {
  return {{a.m[0], a.m[3], a.m[6], a.m[1], a.m[4], a.m[7], a.m[2], a.m[5], a.m[8]}};
}

TRAJOPT_HD inline Mat3<double> hat(const Vec3<double>& r) {
  return {{0, -r.z, r.y, r.z, 0, -r.x, -r.y, r.x, 0}};
}

// d(J_l^-1(h) w)/dh: J_l^-1(h) = I - [h]/2 + k [h]^2, k = k(|h|^2).
TRAJOPT_HD inline Mat3<double> inverse_jacobian_derivative(const Vec3<double>& h,
                                                           const Vec3<double>& w) {
  const double t2 = dot(h, h);
  double k, dk;  // dk = k'/t with k' the derivative by t = |h|
  if (t2 < 1e-4) {
    k = 1.0 / 12 + t2 / 720 + t2 * t2 / 30240;
    dk = 1.0 / 360 + t2 / 7560;
  } else {
    const double t = sqrt(t2);
    double s, c;
    sincos(0.5 * t, s, c);
    const double cot = c / s;
    k = 1 / t2 - cot / (2 * t);
    dk = (-2 / (t2 * t) + cot / (2 * t2) + (1 + cot * cot) / (4 * t)) / t;
  }
  const Mat3<double> x = hat(h);
  const Vec3<double> xxw = x * (x * w);
  Mat3<double> d = scaled(0.5, hat(w));
  add_outer(d, dk, xxw, h);
  add_outer(d, k, h, w);
  add_outer(d, -2 * k, w, h);
  for (int i = 0; i < 3; ++i) d(i, i) += k * dot(h, w);
  return d;
}

// rotations: of frame f, 4 x balls x 9.
TRAJOPT_HD inline void hermite_rotations(const ModelView& model, const SplineView& spline,
                                         const ControlPoints& c, long f, double* rotations) {
  const SplineEnds at(model, spline, c, f);
  const double* w = spline.weights + f % spline.per_segment * 4;
  int ball = 0;
  for (int j = 0; j < model.njoint; ++j) {
    const Joint& joint = model.joints[j];
    if (joint.type != JointType::ball) continue;
    const BallChart chart(joint, at, w);
    const Mat3<double> left = left_jacobian(chart.h);
    Mat3<double> end = scaled(w[2], identity3<double>());
    end += scaled(w[3], inverse_jacobian_derivative(chart.phi, chart.wb));
    const Mat3<double> by_phi = left * end;
    // Start: the chart moves along, R = exp(h) exp(delta) R_a; phi falls by J_l^-T(phi) delta.
    double turn[4];
    quaternion_exp(chart.h, turn);
    Mat3<double> start = quaternion_matrix(turn);
    start += scaled(-1.0, by_phi * transpose(chart.inverse));
    const Mat3<double> blocks[4] = {start, scaled(w[1], left), by_phi * chart.inverse,
                                    scaled(w[3], left * chart.inverse)};
    for (int half = 0; half < 4; ++half) {
      double* out = rotations + (half * spline.balls + ball) * 9;
      for (int k = 0; k < 9; ++k) out[k] = blocks[half].m[k];
    }
    ++ball;
  }
}

}  // namespace TRAJOPT_ISA
}  // namespace trajopt
