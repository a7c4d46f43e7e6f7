// What the launches of an iteration work on (frames_work.h), in the memory of an executor.
#pragma once

#include "trajopt/problem/frame_kernels.h"
#include "trajopt/problem/local_terms.h"
#include "trajopt/problem/step_rows.h"
#include "trajopt/trajectory/hermite_body.h"

namespace trajopt {

// Numbers that the host decides on, read by the launches when they run.
struct Controls {
  double damping;
  double tangential, normal;  // the step d = tangential t + normal n
  double zeta;                // A d = -zeta C
  int from, to;               // trials: one that is corrected, and the one at hand
};

// A point of the search space and what was found there. Frames x_{-1}, x_0 are the same for all,
// but for those of a ring.
struct FramesPoint {
  double* frames;            // (N + 2) x nq
  double* knots;             // of a spline: its state, Z x nq and Z x D
  double* step;              // nodes x primal: what led here from the current point
  double* constraint;        // nodes x dual
  double* frame_constraint;  // N x m; of the frames formulation the same as `constraint`
};

// A term that is a function on the host. Its residuals, N x rows, begin at `first` among those of
// its problem.
struct CallbackTerm {
  long first;
  int rows;
  double weight;
};

// What the launches work on of one problem: plain pointers into the executor's memory.
struct FramesSystem {
  long frame_count;
  FrameInput in;  // its frames are those of the current point
  const LocalTerm* local;
  const CallbackTerm* callback;
  int nlocal, ncallback;
  double smoothing, epsilon;
  bool ring;
  double stride[3];
  const Controls* controls;
  SplineView spline;       // without segments: every frame is a node
  double* rotations;       // of the spline, which points to them
  const double* velocity;  // D: of its fixed control point, x_0
  FramesPoint current, trial[2];
  double *hessian, *gradient, *jacobian;   // as FrameOutput
  double *torque, *cost;                   // N x nu, N x nterm
  double *local_cost, *callback_cost;      // nlocal x N, ncallback x N
  double *frame_gradient, *node_gradient;  // N x D, nodes x primal; frames are nodes: the same
  double *diagonal, *lower;                // of the KKT matrix, a ring's without its last block row
  double *border, *corner;                 // of a ring: that row
  double *rhs, *steps;                     // rows x 2
  double* correction;                      // rows
  double* items;                           // kStepItems x nodes

  TRAJOPT_HD long frames() const { return frame_count; }
  TRAJOPT_HD bool splined() const { return spline.segments > 0; }
  TRAJOPT_HD long nodes() const { return splined() ? spline.segments : frame_count; }
  TRAJOPT_HD int dofs() const { return in.model.ndof; }
  TRAJOPT_HD int constraints() const { return in.model.nunactuated; }  // of a frame
  TRAJOPT_HD int primal() const { return splined() ? 2 * dofs() : dofs(); }
  TRAJOPT_HD int dual() const { return splined() ? 2 * constraints() : constraints(); }
  TRAJOPT_HD int size() const { return 2 * (primal() + dual()); }
  TRAJOPT_HD long blocks() const { return (nodes() + 1) / 2; }
  TRAJOPT_HD long rows() const { return blocks() * size(); }
  TRAJOPT_HD double* block(long g) const {
    return ring && g + 1 == blocks() ? corner : diagonal + g * size() * size();
  }
  TRAJOPT_HD int terms() const { return in.nterm + nlocal + ncallback; }
  // The trial at hand, or the current point.
  TRAJOPT_HD const FramesPoint& point(bool tried) const {
    return tried ? trial[controls->to] : current;
  }
  // The control points of a spline there.
  TRAJOPT_HD ControlPoints control_points(const FramesPoint& at) const {
    const long nq = in.model.nq;
    return {at.frames + nq, velocity, at.knots, at.knots + nodes() * nq};
  }
  TRAJOPT_HD StepRows step_rows() const {
    return {static_cast<int>(nodes()), primal(), dual(), ring, smoothing, node_gradient,
            current.constraint,        steps};
  }
};

// The problems of a launch. All have the same formulation and the same numbers of frames, nodes,
// coordinates, constraints and terms.
struct FramesBatch {
  const FramesSystem* systems;  // by problem
  const int* active;            // how many problems this launch is for, and which
  long places;                  // as many find room in it
  long frames, nodes;
  std::size_t scratch_bytes;  // of one frame
  long lanes;                 // frames in work at once
  unsigned char* scratch;     // lanes x scratch_bytes
  double* row_scratch;        // of a spline: for every block row of every place

  TRAJOPT_HD long blocks() const { return (nodes + 1) / 2; }
  // nullptr: this place is empty.
  TRAJOPT_HD const FramesSystem* system(long place) const {
    return place < active[0] ? systems + active[1 + place] : nullptr;
  }
};

}  // namespace trajopt
