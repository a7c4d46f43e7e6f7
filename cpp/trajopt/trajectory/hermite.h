// Cubic Hermite spline over configurations (Pan section 5.1).
//
// Control point z sits at frame L z and holds a configuration and a velocity scaled to the segment
// (dx/ds, s in [0, 1]). Balls are interpolated in a chart of their own per segment: the rotation
// vector relative to the control point the segment starts at, so nothing ever wraps as long as a
// segment turns by less than pi. What is computed for a frame stands in hermite_body.h.
#pragma once

#include <vector>

#include "trajopt/trajectory/hermite_body.h"

namespace trajopt {

class HermiteSpline {
 public:
  HermiteSpline(const Model& model, int segments, int frames_per_segment);

  int segments() const { return segments_; }
  int frames() const { return segments_ * per_segment_; }

  // out: frames 1..N (N x nq). Frame 0 is the first control point.
  void frames(const ControlPoints& points, double* out, int threads) const;

  // Finds the rotations of frames 1..N at the given control points.
  void linearize(const ControlPoints& points, int threads);
  // With the rotations of the last linearization.
  SplineView view() const;

  // Control points that interpolate given frames 0..N at the knots, velocities by central
  // differences of the frames (N + 1 x nq). q: (Z + 1) x nq, v: (Z + 1) x D, z = 0..Z.
  void fit(const double* frames, double* q, double* v) const;

 private:
  const Model& model_;
  int segments_, per_segment_, balls_;
  std::vector<DofRun> runs_;
  std::vector<double> weights_;    // L x 4
  std::vector<double> plain_;      // L x 4 x D, see SplineView
  std::vector<double> rotations_;  // N x 4 x balls x 9
};

}  // namespace trajopt
