// What the launches of an iteration work on (frames_work.h), in the memory of an executor.
#pragma once

#include "trajopt/problem/frame_kernels.h"
#include "trajopt/problem/local_terms.h"
#include "trajopt/problem/step_rows.h"

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
  double* frames;      // (N + 2) x nq
  double* step;        // N x D: what led here from the current point
  double* constraint;  // N x m
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
  FramesPoint current, trial[2];
  double *hessian, *gradient, *jacobian;  // as FrameOutput
  double *torque, *cost;                  // N x nu, N x nterm
  double *local_cost, *callback_cost;     // nlocal x N, ncallback x N
  double* node_gradient;                  // N x D
  double *diagonal, *lower;               // of the KKT matrix, a ring's without its last block row
  double *border, *corner;                // of a ring: that row
  double *rhs, *steps;                    // rows x 2
  double* correction;                     // rows
  double* items;                          // kStepItems x N

  TRAJOPT_HD long frames() const { return frame_count; }
  TRAJOPT_HD int primal() const { return in.model.ndof; }
  TRAJOPT_HD int dual() const { return in.model.nunactuated; }
  TRAJOPT_HD int size() const { return 2 * (primal() + dual()); }
  TRAJOPT_HD long blocks() const { return (frame_count + 1) / 2; }
  TRAJOPT_HD long rows() const { return blocks() * size(); }
  TRAJOPT_HD double* block(long g) const {
    return ring && g + 1 == blocks() ? corner : diagonal + g * size() * size();
  }
  TRAJOPT_HD int terms() const { return in.nterm + nlocal + ncallback; }
  // The trial at hand, or the current point.
  TRAJOPT_HD const FramesPoint& point(bool tried) const {
    return tried ? trial[controls->to] : current;
  }
  TRAJOPT_HD StepRows step_rows() const {
    return {static_cast<int>(frame_count),
            primal(),
            dual(),
            ring,
            smoothing,
            node_gradient,
            current.constraint,
            steps};
  }
};

// The problems of a launch. All have the same numbers of frames, coordinates, constraints and
// terms.
struct FramesBatch {
  const FramesSystem* systems;  // by problem
  const int* active;            // how many problems this launch is for, and which
  long places;                  // as many find room in it
  long frames;
  std::size_t scratch_bytes;  // of one frame
  long lanes;                 // frames in work at once
  unsigned char* scratch;     // lanes x scratch_bytes

  TRAJOPT_HD long blocks() const { return (frames + 1) / 2; }
  // nullptr: this place is empty.
  TRAJOPT_HD const FramesSystem* system(long place) const {
    return place < active[0] ? systems + active[1 + place] : nullptr;
  }
};

}  // namespace trajopt
