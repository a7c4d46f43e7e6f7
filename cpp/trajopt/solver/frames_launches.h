// The launches that answer a request, recorded once for a number of problems.
#pragma once

#include <algorithm>
#include <bit>
#include <vector>

#include "trajopt/problem/kkt_system.h"
#include "trajopt/solver/frames_memory.h"
#include "trajopt/solver/host_terms.h"

namespace trajopt {

template <class Device>
class FramesLaunches {
 public:
  FramesLaunches(Device& device, typename Device::Solver& solver, FramesMemory<Device>& memory,
                 HostTerms<Device>& host_terms)
      : device_(device), solver_(solver), memory_(memory), host_terms_(host_terms) {}

  // Plays the launches for `problems`, which memory.active lists, of what memory.controls says.
  // Functions of the user are called on the way: what they throw is among the answers.
  void play(Request::Kind kind, const std::vector<int>& problems, std::vector<Answer>& answers) {
    const std::size_t count = problems.size();
    if (!host_terms_.any() || kind == Request::Kind::steps) {
      device_.play(recording(kind, Part::whole, count));
      return;
    }
    device_.play(recording(kind, Part::point, count));
    if (host_terms_.evaluate(problems, linearizes(kind), answers))
      device_.play(recording(kind, Part::values, count));
  }

 private:
  using Recording = typename Device::Recording;
  // The way to a point and what is found there; between the two, a host may have work to do.
  enum class Part { whole, point, values };
  static constexpr int kParts = 3;

  static bool linearizes(Request::Kind kind) {
    return kind == Request::Kind::linearize || kind == Request::Kind::move;
  }

  // The recording for a number of problems: for the next power of two, made when first needed.
  // Few problems that are left then do not pay for many that have ended.
  const Recording& recording(Request::Kind kind, Part part, std::size_t problems) {
    const std::size_t level = std::bit_width(problems - 1);
    if (recordings_.size() <= level) recordings_.resize(level + 1);
    Recordings& r = recordings_[level];
    const std::size_t at = static_cast<std::size_t>(kind) * kParts + static_cast<int>(part);
    if (!r.made[at]) {
      FramesBatch batch = memory_.batch();
      batch.places = std::min<long>(1L << level, memory_.count());
      batch.lanes = std::min(batch.lanes, batch.places * batch.frames);
      solver_.list(memory_.device_active, static_cast<int>(batch.places));
      r.of[at] = device_.record([&] {
        if (part != Part::values) enqueue_point(kind, batch);
        if (part != Part::point) enqueue_values(kind, batch);
      });
      r.made[at] = true;
    }
    return r.of[at];
  }

  // Up to where the numbers are that were asked for.
  void enqueue_point(Request::Kind kind, const FramesBatch& b) {
    FramesMemory<Device>& m = memory_;
    device_.copy_in(m.device_active, m.active, (1 + b.places) * sizeof(int));
    device_.copy_in(m.device_controls, m.controls, m.count() * sizeof(Controls));
    switch (kind) {
      case Request::Kind::move:
        device_(NodesWork<AcceptTrial>{b});
        break;
      // One sequence of launches up to the steps' numbers: nothing of it is worth an answer before.
      case Request::Kind::steps:
        m.splined() ? device_(AssembleSplineWork{b}) : device_(AssembleWork{b});
        solver_.factor();
        device_.copy_out(m.failed, solver_.failed(), m.count() * sizeof(int));
        device_(NodesWork<RemoveEpsilon>{b});
        device_(NodesWork<WriteStepsRhs>{b});
        solver_.solve(m.steps, 2);
        solver_.refine(m.rhs, m.steps, 2, KktSystem::kRefinements, KktSystem::kRefineTolerance);
        return;
      case Request::Kind::trial:
        device_(NodesWork<ComposeStep>{b});
        break;
      case Request::Kind::correction:
        device_(NodesWork<WriteCorrectionRhs>{b});
        solver_.solve(m.correction, 1);
        device_(NodesWork<ApplyCorrection>{b});
        break;
      default:
        break;
    }
    if (m.splined() && linearizes(kind)) device_(NodesWork<SplineFrames<false>>{b});
    if (m.splined() && !linearizes(kind)) device_(NodesWork<SplineFrames<true>>{b});
    if (host_terms_.any()) host_terms_.fetch_frames(device_, b, !linearizes(kind));
  }

  void enqueue_values(Request::Kind kind, const FramesBatch& b) {
    const FramesMemory<Device>& m = memory_;
    if (kind == Request::Kind::steps) {
      device_(NodesWork<MeasureSteps>{b});
      fold<StepItems>(b, false, m.step_folds());
      return;
    }
    const bool derivatives = linearizes(kind);
    if (derivatives) {
      device_(FramesWork<true>{b, false});
      if (m.splined()) device_(NodesWork<ReduceConstraint<false>>{b});
    } else {
      device_(FramesWork<false>{b, true});
      if (m.splined()) device_(NodesWork<ReduceConstraint<true>>{b});
    }
    if (host_terms_.any()) {
      host_terms_.add_costs(device_, b);
      if (derivatives) host_terms_.add_derivatives(device_, b);
    }
    fold<PointItems>(b, !derivatives, m.point_folds());
    if (!derivatives) return;
    device_(NodesWork<GatherGradient>{b});
    if (m.splined()) {
      device_(NodesWork<SplineRotations>{b});
      device_(NodesWork<ReduceGradient>{b});
    }
  }

  template <class Items>
  void fold(const FramesBatch& b, bool tried, const Folds& f) {
    FramesMemory<Device>& m = memory_;
    device_(FoldChunksWork<Items>{b, tried, f, m.partial});
    device_(FoldRestWork{b, f, m.partial, m.device_results});
    device_.copy_out(m.results, m.device_results, b.places * f.folds * sizeof(double));
  }

  struct Recordings {
    Recording of[Request::kKinds * kParts];
    bool made[Request::kKinds * kParts] = {};
  };

  Device& device_;
  typename Device::Solver& solver_;
  FramesMemory<Device>& memory_;
  HostTerms<Device>& host_terms_;
  std::vector<Recordings> recordings_;  // by the binary logarithm of the places
};

}  // namespace trajopt
