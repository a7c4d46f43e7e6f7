// Cubic Hermite spline over configurations (Pan section 5.1).
//
// Control point z sits at frame L z and holds a configuration and a velocity scaled to the segment
// (dx/ds, s in [0, 1]). Balls are interpolated in a chart of their own per segment: the rotation
// vector relative to the control point the segment starts at, so nothing ever wraps as long as a
// segment turns by less than pi.
#pragma once

#include <vector>

#include "trajopt/model/model.h"

namespace trajopt {

// How frame i hangs on one half of a control point (its configuration or its velocity).
struct SplineWeight {
  int node;      // z - 1 for control points z = 1..Z (the unknowns); -1 for the fixed z = 0
  int half;      // 0: configuration, 1: velocity
  double value;  // for slides and hinges, and for the test functions
  const double* rotation;  // per ball of the model a 3x3 matrix: tangent of the frame by this half
};

struct SplineFrame {
  SplineWeight weights[4];
};

class HermiteSpline {
 public:
  HermiteSpline(const Model& model, int segments, int frames_per_segment);

  int segments() const { return segments_; }
  int frames() const { return segments_ * per_segment_; }

  // q: (Z + 1) x nq configurations, v: (Z + 1) x D scaled velocities, z = 0..Z.
  // out: frames 0..N (N + 1) x nq.
  void frames(const double* q, const double* v, double* out) const;

  // Weights of frames 1..N at the given control points; with `rotations` also the 3x3 blocks.
  void linearize(const double* q, const double* v);
  const SplineFrame& weights(int frame) const { return weights_[frame - 1]; }

  // Control points that interpolate given frames 0..N at the knots, velocities by central
  // differences of the frames (N + 1 x nq).
  void fit(const double* frames, double* q, double* v) const;

 private:
  const Model& model_;
  int segments_, per_segment_, balls_;
  std::vector<SplineFrame> weights_;  // N
  std::vector<double> rotations_;     // N x 4 x balls x 9
};

}  // namespace trajopt
