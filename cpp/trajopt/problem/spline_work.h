// The launches that a spline needs beside those of frames_work.h: its frames and how they hang on
// the control points, what a control point gathers, and the KKT matrix.
#pragma once

#include "trajopt/problem/frames_work.h"
#include "trajopt/problem/spline_block_row.h"

namespace trajopt::inline TRAJOPT_ISA {

// Of the trial, or of the current point.
template <bool Tried>
struct SplineFrames {
  static constexpr const char* kName = "frames of the spline";
  static constexpr Over kOver = Over::frames;
  TRAJOPT_HD void operator()(const FramesSystem& s, long f) const {
    const FramesPoint& at = s.point(Tried);
    hermite_frame(s.in.model, s.spline, s.control_points(at), f,
                  at.frames + (f + 2) * s.in.model.nq);
  }
};

struct SplineRotations {
  static constexpr const char* kName = "rotations of the spline";
  static constexpr Over kOver = Over::frames;
  TRAJOPT_HD void operator()(const FramesSystem& s, long f) const {
    hermite_rotations(s.in.model, s.spline, s.control_points(s.current), f,
                      s.rotations + f * 36 * s.spline.balls);
  }
};

template <bool Tried>
struct ReduceConstraint {
  static constexpr const char* kName = "reduce constraint";
  static constexpr Over kOver = Over::nodes;
  TRAJOPT_HD void operator()(const FramesSystem& s, long node) const {
    const FramesPoint& at = s.point(Tried);
    reduce_constraint(s.spline, s.constraints(), at.frame_constraint, node,
                      at.constraint + node * s.dual());
  }
};

struct ReduceGradient {
  static constexpr const char* kName = "reduce gradient";
  static constexpr Over kOver = Over::nodes;
  TRAJOPT_HD void operator()(const FramesSystem& s, long node) const {
    reduce_gradient(s.spline, s.dofs(), s.frame_gradient, node,
                    s.node_gradient + node * s.primal());
  }
};

// The KKT matrix at the damping in `controls`, a block row per group: for D = 18 and ten frames a
// segment some 30 D^2 fused multiply-adds a frame, on windows read one and a half times. The
// diagonal of the multipliers is -epsilon.
struct AssembleSplineWork {
  static constexpr const char* kName = "assemble spline";
  static constexpr int kMaxRanks = 256;
  FramesBatch b;

  TRAJOPT_HD long jobs() const { return b.places * b.blocks(); }
  TRAJOPT_HD int ranks() const { return kMaxRanks; }
  std::size_t bytes() const { return 0; }

  template <class Group>
  TRAJOPT_HD void operator()(const Group& group, long job, void*) const {
    const FramesSystem* system = b.system(job / b.blocks());
    if (system == nullptr) return;
    const FramesSystem& s = *system;
    const long g = job % b.blocks();
    const int d = s.dofs();
    const SplineRows rows{s.spline,  d,          s.constraints(), s.controls->damping,
                          s.hessian, s.jacobian, s.diagonal,      s.lower};
    write_spline_block_row(group, rows, g, b.row_scratch + job * spline_row_scratch(d));
    for_each(group, s.size(), [&](int r) {
      const bool padding = 2 * g + r / rows.width() >= s.nodes();
      if (!padding && r % rows.width() < s.dual()) *rows.entry(2 * g, r, 2 * g, r) = -s.epsilon;
    });
  }
};

}  // namespace trajopt::inline TRAJOPT_ISA
