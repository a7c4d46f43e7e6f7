// The launches of one iteration of the frames formulation, one type each (linalg/group_work.h says
// what a launch is), for many problems at once. They run the bodies that the processor's executor
// runs; here stands only who does which frame, node or block row, and where its numbers lie.
#pragma once

#include "trajopt/problem/frame_body.h"
#include "trajopt/problem/kkt_rows.h"
#include "trajopt/problem/local_terms.h"
#include "trajopt/problem/ring.h"
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

// What the launches work on of one problem: plain pointers into the executor's memory.
struct FramesSystem {
  long frame_count;
  FrameInput in;  // its frames are those of the current point
  const LocalTerm* local;
  int nlocal;
  double smoothing, epsilon;
  bool ring;
  double stride[3];
  const Controls* controls;
  FramesPoint current, trial[2];
  double *hessian, *gradient, *jacobian;  // as FrameOutput
  double *torque, *cost;                  // N x nu, N x nterm
  double* local_cost;                     // nlocal x N
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
  TRAJOPT_HD int terms() const { return in.nterm + nlocal; }
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

inline namespace TRAJOPT_ISA {

// Dynamics, objective rows and local terms, a frame per rank. Floor for D = 18: 45 kflop for a
// linearization without its Gram matrix, 10 kflop for an evaluation (bench/_cost.py counts them);
// the window's 6 D^2 + 3 m D doubles are written once. A rank keeps its frame's intermediate
// results in memory of its own: this launch waits for memory, not for arithmetic.
template <bool Derivatives>
struct FramesWork {
  static constexpr const char* kName = Derivatives ? "linearize frames" : "evaluate frames";
  static constexpr int kMaxRanks = 32;
  FramesBatch b;
  bool tried;  // the trial, or the current point

  TRAJOPT_HD long jobs() const { return (b.lanes + ranks() - 1) / ranks(); }
  // Few frames are spread over the whole device.
  TRAJOPT_HD int ranks() const {
    constexpr int kMultiprocessors = 128;
    int n = 1;
    while (n < kMaxRanks && n * kMultiprocessors < b.lanes) n *= 2;
    return n;
  }
  std::size_t bytes() const { return 0; }

  template <class Group>
  TRAJOPT_HD void operator()(const Group& group, long job, void*) const {
    const long count = b.active[0] * b.frames;
    for_each(group, ranks(), [&](int rank) {
      const long lane = job * ranks() + rank;
      if (lane >= b.lanes) return;
      void* memory = b.scratch + lane * b.scratch_bytes;
      for (long k = lane; k < count; k += b.lanes)
        frame(*b.system(k / b.frames), k % b.frames, memory);
    });
  }

  TRAJOPT_HD void frame(const FramesSystem& s, long f, void* memory) const {
    const FramesPoint& at = s.point(tried);
    const long d = s.primal();
    FrameInput in = s.in;
    in.frames = at.frames;
    run_frames<double, Derivatives>(
        in, f, 1, memory, {at.constraint, s.torque, s.cost, s.hessian, s.gradient, s.jacobian});
    const LocalFrame local = local_frame(in, f);
    for (int k = 0; k < s.nlocal; ++k) {
      s.local_cost[k * b.frames + f] = add_local_term<Derivatives>(
          in.model, s.local[k], local, Derivatives ? s.hessian + f * 6 * d * d : nullptr,
          Derivatives ? s.gradient + f * 3 * d : nullptr);
    }
  }
};

// What a point is judged by: the sum of each term, and the largest constraint.
struct PointItems {
  const double *cost, *local_cost, *constraint;
  int nterm, nlocal, m;
  long frames;

  TRAJOPT_HD PointItems(const FramesSystem& s, bool tried)
      : cost(s.cost),
        local_cost(s.local_cost),
        constraint(s.point(tried).constraint),
        nterm(s.in.nterm),
        nlocal(s.nlocal),
        m(s.dual()),
        frames(s.frames()) {}
  TRAJOPT_HD double operator()(int fold, long f) const {
    if (fold < nterm) return cost[f * nterm + fold];
    if (fold < nterm + nlocal) return local_cost[(fold - nterm) * frames + f];
    double most = 0.0;
    for (int r = 0; r < m; ++r) most = Largest{}(most, magnitude(constraint[f * m + r]));
    return most;
  }
};

struct StepItems {
  const double* items;
  long nodes;
  TRAJOPT_HD StepItems(const FramesSystem& s, bool) : items(s.items), nodes(s.frames()) {}
  TRAJOPT_HD double operator()(int fold, long i) const { return items[fold * nodes + i]; }
};

// Folds of several sequences of a problem's items, as two launches: all chunks, then what is left
// of each sequence. Of the last sequence the largest value is wanted, of the others the sum.
template <class Items>
struct FoldChunksWork {
  static constexpr const char* kName = "fold chunks";
  static constexpr int kMaxRanks = kTreeWidth;
  FramesBatch b;
  bool tried;
  int folds;
  double* partial;  // places x folds x chunks

  TRAJOPT_HD long jobs() const { return b.places * folds * tree_chunks(b.frames); }
  TRAJOPT_HD int ranks() const { return kMaxRanks; }
  std::size_t bytes() const { return kTreeWidth * sizeof(double); }

  template <class Group>
  TRAJOPT_HD void operator()(const Group& group, long job, void* space) const {
    double* slots = static_cast<double*>(space);
    const long chunks = tree_chunks(b.frames), begin = job % chunks * kTreeWidth;
    const int fold = static_cast<int>(job / chunks % folds);
    const FramesSystem* s = b.system(job / chunks / folds);
    if (s == nullptr) return;
    const Items items(*s, tried);
    const auto get = [&](long i) { return items(fold, i); };
    if (fold + 1 < folds) {
      fold_chunk<Sum>(group, begin, b.frames, get, slots);
    } else {
      fold_chunk<Largest>(group, begin, b.frames, get, slots);
    }
    for_each(group, 1, [&](int) { partial[job] = slots[0]; });
  }
};

struct FoldRestWork {
  static constexpr const char* kName = "fold rest";
  static constexpr int kMaxRanks = kTreeWidth;
  FramesBatch b;
  int folds;
  double* partial;  // places x folds x chunks; overwritten
  double* result;   // places x folds

  TRAJOPT_HD long jobs() const { return b.places * folds; }
  TRAJOPT_HD int ranks() const { return kMaxRanks; }
  std::size_t bytes() const { return kTreeWidth * sizeof(double); }

  template <class Group>
  TRAJOPT_HD void operator()(const Group& group, long job, void* space) const {
    if (b.system(job / folds) == nullptr) return;
    double* slots = static_cast<double*>(space);
    const long chunks = tree_chunks(b.frames);
    double* values = partial + job * chunks;
    if (chunks > 1) {
      if (job % folds + 1 < folds) {
        fold_tree<Sum>(group, values, chunks, slots);
      } else {
        fold_tree<Largest>(group, values, chunks, slots);
      }
    }
    for_each(group, 1, [&](int) { result[job] = values[0]; });
  }
};

// A launch of body(system, i) for the nodes i of every problem, a rank each. A body that is
// `padded` sees the node, too, that fills the last block of an odd count.
template <class Body>
struct NodesWork {
  static constexpr const char* kName = Body::kName;
  static constexpr int kMaxRanks = 64;
  FramesBatch b;

  TRAJOPT_HD long count() const { return Body::kPadded ? 2 * b.blocks() : b.frames; }
  TRAJOPT_HD long chunks() const { return (count() + kMaxRanks - 1) / kMaxRanks; }
  TRAJOPT_HD long jobs() const { return b.places * chunks(); }
  TRAJOPT_HD int ranks() const { return kMaxRanks; }
  std::size_t bytes() const { return 0; }

  template <class Group>
  TRAJOPT_HD void operator()(const Group& group, long job, void*) const {
    const FramesSystem* s = b.system(job / chunks());
    if (s == nullptr) return;
    const long first = job % chunks() * kMaxRanks, n = count();
    for_each(group, kMaxRanks, [&](int rank) {
      if (first + rank < n) Body()(*s, first + rank);
    });
  }
};

struct GatherGradient {
  static constexpr const char* kName = "gather gradient";
  static constexpr bool kPadded = false;
  TRAJOPT_HD void operator()(const FramesSystem& s, long i) const {
    gather_gradient(s.gradient, s.frames(), s.primal(), s.ring, i, s.node_gradient + i * s.primal());
  }
};

// Right-hand sides of both steps, twice: one is solved in place, one kept for the refinement. The
// node that pads an odd count has zeros.
struct WriteStepsRhs {
  static constexpr const char* kName = "right-hand sides";
  static constexpr bool kPadded = true;
  TRAJOPT_HD void operator()(const FramesSystem& s, long i) const {
    const int width = s.size();  // of a node, two columns
    if (i < s.frames()) {
      write_steps_rhs(s.step_rows(), i);
    } else {
      for (int k = 0; k < width; ++k) s.steps[i * width + k] = 0.0;
    }
    for (int k = 0; k < width; ++k) s.rhs[i * width + k] = s.steps[i * width + k];
  }
};

struct MeasureSteps {
  static constexpr const char* kName = "measure steps";
  static constexpr bool kPadded = false;
  TRAJOPT_HD void operator()(const FramesSystem& s, long i) const {
    measure_steps(s.step_rows(), i, s.items, s.frames());
  }
};

// The configuration of node i at a point, from its step there.
TRAJOPT_HD inline void retract_node(const FramesSystem& s, const FramesPoint& to, long i) {
  const long q = (i + 2) * s.in.model.nq;
  integrate_body(s.in.model, s.current.frames + q, to.step + i * s.primal(), to.frames + q);
  if (s.ring && i + 2 >= s.frames()) {
    double* before = to.frames + (i + 2 - s.frames()) * s.in.model.nq;
    one_period_before(s.in.model, s.stride, to.frames + q, before);
  }
}

struct ComposeStep {
  static constexpr const char* kName = "compose step";
  static constexpr bool kPadded = false;
  TRAJOPT_HD void operator()(const FramesSystem& s, long i) const {
    const FramesPoint& to = s.point(true);
    compose_step(s.step_rows(), i, s.controls->tangential, s.controls->normal, to.step);
    retract_node(s, to, i);
  }
};

struct WriteCorrectionRhs {
  static constexpr const char* kName = "correction's right-hand side";
  static constexpr bool kPadded = true;
  TRAJOPT_HD void operator()(const FramesSystem& s, long i) const {
    if (i < s.frames()) {
      const double* constraint = s.trial[s.controls->from].constraint;
      write_correction_rhs(s.step_rows(), i, s.controls->zeta, constraint, s.correction);
    } else {
      for (int k = 0; k < s.size() / 2; ++k) s.correction[i * (s.size() / 2) + k] = 0.0;
    }
  }
};

struct ApplyCorrection {
  static constexpr const char* kName = "apply correction";
  static constexpr bool kPadded = false;
  TRAJOPT_HD void operator()(const FramesSystem& s, long i) const {
    const FramesPoint& to = s.point(true);
    add_correction(s.step_rows(), i, s.correction, s.trial[s.controls->from].step, to.step);
    retract_node(s, to, i);
  }
};

// The trial becomes the current point; its values there are found anew by the linearization.
struct AcceptTrial {
  static constexpr const char* kName = "accept trial";
  static constexpr bool kPadded = false;
  TRAJOPT_HD void operator()(const FramesSystem& s, long i) const {
    const int nq = s.in.model.nq;
    const double* from = s.point(true).frames;
    const auto accept = [&](long frame) {
      for (long k = frame * nq; k < (frame + 1) * nq; ++k) s.current.frames[k] = from[k];
    };
    accept(i + 2);
    if (s.ring && i + 2 >= s.frames()) accept(i + 2 - s.frames());
  }
};

// The KKT matrix at the damping in `controls`, a block row per group: for D = 18 this reads 3 D^2
// and writes 1.5 to 2.5 D^2 + 3 m D doubles a node. The diagonal of the multipliers is -epsilon.
struct AssembleWork {
  static constexpr const char* kName = "assemble";
  static constexpr int kMaxRanks = 128;
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
    const int d = s.primal(), m = s.dual(), n = static_cast<int>(s.frames()), size = s.size();
    const KktRows rows{n,         d,          m,          s.ring,  s.smoothing, s.controls->damping,
                       s.hessian, s.jacobian, s.diagonal, s.lower, s.border,    s.corner};
    write_block_row(group, rows, g);
    double* diagonal = s.block(g);
    const bool padded = 2 * g + 1 == n;  // its second half is the identity
    for_each(group, size, [&](int r) {
      double* at = diagonal + static_cast<long>(r) * size + r;
      if (r % (d + m) < m) *at = -s.epsilon;
      if (padded && r >= d + m) *at = 1.0;
    });
  }
};

// Takes epsilon out again, for the refinement.
struct RemoveEpsilon {
  static constexpr const char* kName = "remove epsilon";
  static constexpr bool kPadded = false;
  TRAJOPT_HD void operator()(const FramesSystem& s, long i) const {
    const long size = s.size(), first = i % 2 * (size / 2);
    double* block = s.block(i / 2);
    for (long k = first; k < first + s.dual(); ++k) block[k * size + k] = 0.0;
  }
};

}  // namespace TRAJOPT_ISA
}  // namespace trajopt
