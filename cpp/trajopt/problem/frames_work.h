// The launches of one iteration, one type each (linalg/group_work.h says what a launch is), for
// many problems at once; what a spline needs beside them is in spline_work.h. They run the bodies
// that the processor's executor runs; here stands only who does which frame, node or block row, and
// where its numbers lie.
#pragma once

#include "trajopt/problem/fold_work.h"
#include "trajopt/problem/frame_group.h"
#include "trajopt/problem/frames_system.h"
#include "trajopt/problem/kkt_rows.h"
#include "trajopt/problem/ring.h"
#include "trajopt/problem/spline_rows.h"

namespace trajopt::inline TRAJOPT_ISA {

// Dynamics, objective rows and local terms, a frame per rank; the products of a linearization's
// rows by all ranks. Floor for D = 18: 45 kflop for a linearization without its Gram matrix, 10
// kflop for an evaluation (bench/_cost.py counts them); the window's 6 D^2 + 3 m D doubles are
// written once. A rank keeps its frame's intermediate results in memory of its own: this launch
// waits for memory, not for arithmetic.
template <bool Derivatives>
struct FramesWork {
  static constexpr const char* kName = Derivatives ? "linearize frames" : "evaluate frames";
  static constexpr int kMaxRanks = 128, kWarp = 32;
  FramesBatch b;
  bool tried;  // the trial, or the current point

  TRAJOPT_HD long jobs() const { return (b.lanes + share() - 1) / share(); }
  // Frames of a job at a time. Few are spread over the whole device, and in a job over its warps:
  // they need not do the same.
  TRAJOPT_HD int share() const {
    constexpr int kMultiprocessors = 128;
    int n = 1;
    while (n < kWarp && n * kMultiprocessors < b.lanes) n *= 2;
    return n;
  }
  TRAJOPT_HD int ranks() const { return share() < kWarp ? kMaxRanks : kWarp; }
  std::size_t bytes() const { return 0; }

  template <class Group>
  TRAJOPT_HD void operator()(const Group& group, long job, void*) const {
    const long count = b.active[0] * b.frames, lane = job * share();
    const long left = b.lanes - lane < share() ? b.lanes - lane : share();
    for (long first = lane; first < count; first += b.lanes) {
      const int frames = static_cast<int>(count - first < left ? count - first : left);
      each_frame(group, frames, [&](int k) {
        const FramesSystem& s = system(first + k);
        find_rows<Derivatives>(input(s), frame(first + k), memory(lane + k), output(s));
        if constexpr (!Derivatives) add_local(s, frame(first + k));
      });
      if constexpr (Derivatives) {
        for (int k = 0; k < frames; ++k) {
          const FramesSystem& s = system(first + k);
          multiply_rows(group, input(s), frame(first + k), memory(lane + k), output(s));
        }
        each_frame(group, frames, [&](int k) { add_local(system(first + k), frame(first + k)); });
      }
    }
  }

  // body(k) for k in [0, frames), by ranks that lie apart.
  template <class Group, class Body>
  TRAJOPT_HD void each_frame(const Group& group, int frames, const Body& body) const {
    const int apart = ranks() / share();
    for_each(group, frames * apart, [&](int rank) {
      if (rank % apart == 0) body(rank / apart);
    });
  }

  TRAJOPT_HD const FramesSystem& system(long k) const { return *b.system(k / b.frames); }
  TRAJOPT_HD long frame(long k) const { return k % b.frames; }
  TRAJOPT_HD unsigned char* memory(long lane) const { return b.scratch + lane * b.scratch_bytes; }
  TRAJOPT_HD FrameInput input(const FramesSystem& s) const {
    FrameInput in = s.in;
    in.frames = s.point(tried).frames;
    return in;
  }
  TRAJOPT_HD FrameOutput output(const FramesSystem& s) const {
    return {s.point(tried).frame_constraint, s.torque, s.cost, s.hessian, s.gradient, s.jacobian};
  }

  TRAJOPT_HD void add_local(const FramesSystem& s, long f) const {
    const long d = s.dofs();
    const LocalFrame local = local_frame(input(s), f);
    for (int k = 0; k < s.nlocal; ++k) {
      s.local_cost[k * b.frames + f] = add_local_term<Derivatives>(
          s.in.model, s.local[k], local, Derivatives ? s.hessian + f * 6 * d * d : nullptr,
          Derivatives ? s.gradient + f * 3 * d : nullptr);
    }
  }
};

// What a launch goes over; padded: with the node that fills the last block of an odd count.
enum class Over { frames, nodes, padded_nodes };

// A launch of body(system, i) for the nodes or frames i of every problem, a rank each.
template <class Body>
struct NodesWork {
  static constexpr const char* kName = Body::kName;
  static constexpr int kMaxRanks = 64;
  FramesBatch b;

  TRAJOPT_HD long count() const {
    if (Body::kOver == Over::frames) return b.frames;
    return Body::kOver == Over::nodes ? b.nodes : 2 * b.blocks();
  }
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
  static constexpr Over kOver = Over::frames;
  TRAJOPT_HD void operator()(const FramesSystem& s, long i) const {
    gather_gradient(s.gradient, s.frames(), s.dofs(), s.ring, i, s.frame_gradient + i * s.dofs());
  }
};

// Right-hand sides of both steps, twice: one is solved in place, one kept for the refinement. The
// node that pads an odd count has zeros.
struct WriteStepsRhs {
  static constexpr const char* kName = "right-hand sides";
  static constexpr Over kOver = Over::padded_nodes;
  TRAJOPT_HD void operator()(const FramesSystem& s, long i) const {
    const int width = s.size();  // of a node, two columns
    if (i < s.nodes()) {
      write_steps_rhs(s.step_rows(), i);
    } else {
      for (int k = 0; k < width; ++k) s.steps[i * width + k] = 0.0;
    }
    for (int k = 0; k < width; ++k) s.rhs[i * width + k] = s.steps[i * width + k];
  }
};

struct MeasureSteps {
  static constexpr const char* kName = "measure steps";
  static constexpr Over kOver = Over::nodes;
  TRAJOPT_HD void operator()(const FramesSystem& s, long i) const {
    measure_steps(s.step_rows(), i, s.items, s.nodes());
  }
};

// Node i at a point, from its step there.
TRAJOPT_HD inline void retract_node(const FramesSystem& s, const FramesPoint& to, long i) {
  if (s.splined()) {
    retract_control_point(s.in.model, s.spline, s.current.knots, to.step, i, to.knots);
    return;
  }
  const long q = (i + 2) * s.in.model.nq;
  integrate_body(s.in.model, s.current.frames + q, to.step + i * s.primal(), to.frames + q);
  if (s.ring && i + 2 >= s.frames()) {
    double* before = to.frames + (i + 2 - s.frames()) * s.in.model.nq;
    one_period_before(s.in.model, s.stride, to.frames + q, before);
  }
}

struct ComposeStep {
  static constexpr const char* kName = "compose step";
  static constexpr Over kOver = Over::nodes;
  TRAJOPT_HD void operator()(const FramesSystem& s, long i) const {
    const FramesPoint& to = s.point(true);
    compose_step(s.step_rows(), i, s.controls->tangential, s.controls->normal, to.step);
    retract_node(s, to, i);
  }
};

struct WriteCorrectionRhs {
  static constexpr const char* kName = "correction's right-hand side";
  static constexpr Over kOver = Over::padded_nodes;
  TRAJOPT_HD void operator()(const FramesSystem& s, long i) const {
    if (i < s.nodes()) {
      const double* constraint = s.trial[s.controls->from].constraint;
      write_correction_rhs(s.step_rows(), i, s.controls->zeta, constraint, s.correction);
    } else {
      for (int k = 0; k < s.size() / 2; ++k) s.correction[i * (s.size() / 2) + k] = 0.0;
    }
  }
};

struct ApplyCorrection {
  static constexpr const char* kName = "apply correction";
  static constexpr Over kOver = Over::nodes;
  TRAJOPT_HD void operator()(const FramesSystem& s, long i) const {
    const FramesPoint& to = s.point(true);
    add_correction(s.step_rows(), i, s.correction, s.trial[s.controls->from].step, to.step);
    retract_node(s, to, i);
  }
};

// The trial becomes the current point; its values there are found anew by the linearization.
struct AcceptTrial {
  static constexpr const char* kName = "accept trial";
  static constexpr Over kOver = Over::nodes;
  TRAJOPT_HD void operator()(const FramesSystem& s, long i) const {
    const int nq = s.in.model.nq;
    const FramesPoint& from = s.point(true);
    if (s.splined()) {
      accept_control_point(s.in.model, s.spline, from.knots, i, s.current.knots);
      return;
    }
    const auto accept = [&](long frame) {
      for (long k = frame * nq; k < (frame + 1) * nq; ++k) s.current.frames[k] = from.frames[k];
    };
    accept(i + 2);
    if (s.ring && i + 2 >= s.frames()) accept(i + 2 - s.frames());
  }
};

// The KKT matrix of frames at the damping in `controls`, a block row per group: for D = 18 this
// reads 3 D^2 and writes 1.5 to 2.5 D^2 + 3 m D doubles a node. The diagonal of the multipliers is
// -epsilon.
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
    const int d = s.primal(), m = s.dual(), n = static_cast<int>(s.nodes()), size = s.size();
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
  static constexpr Over kOver = Over::nodes;
  TRAJOPT_HD void operator()(const FramesSystem& s, long i) const {
    const long size = s.size(), first = i % 2 * (size / 2);
    double* block = s.block(i / 2);
    for (long k = first; k < first + s.dual(); ++k) block[k * size + k] = 0.0;
  }
};

}  // namespace trajopt::inline TRAJOPT_ISA
