// The launches that answer a request, recorded once for a number of problems.
#pragma once

#include <algorithm>
#include <bit>
#include <vector>

#include "trajopt/problem/kkt_system.h"
#include "trajopt/solver/frames_memory.h"

namespace trajopt {

template <class Device>
class FramesLaunches {
 public:
  FramesLaunches(Device& device, typename Device::Solver& solver, FramesMemory<Device>& memory)
      : device_(device), solver_(solver), memory_(memory) {}

  // Plays the launches for the problems that memory.active lists, of what memory.controls says.
  void play(Request::Kind kind, std::size_t problems) { device_.play(recording(kind, problems)); }

 private:
  using Recording = typename Device::Recording;

  // The recording for a number of problems: for the next power of two, made when first needed.
  // Few problems that are left then do not pay for many that have ended.
  const Recording& recording(Request::Kind kind, std::size_t problems) {
    const std::size_t level = std::bit_width(problems - 1);
    if (recordings_.size() <= level) recordings_.resize(level + 1);
    Recordings& r = recordings_[level];
    const std::size_t at = static_cast<std::size_t>(kind);
    if (!r.made[at]) {
      FramesBatch batch = memory_.batch();
      batch.places = std::min<long>(1L << level, memory_.count());
      batch.lanes = std::min(batch.lanes, batch.places * batch.frames);
      solver_.list(memory_.device_active, static_cast<int>(batch.places));
      r.of[at] = device_.record([&] { enqueue(kind, batch); });
      r.made[at] = true;
    }
    return r.of[at];
  }

  void enqueue(Request::Kind kind, const FramesBatch& b) {
    FramesMemory<Device>& m = memory_;
    device_.copy_in(m.device_active, m.active, (1 + b.places) * sizeof(int));
    device_.copy_in(m.device_controls, m.controls, m.count() * sizeof(Controls));
    switch (kind) {
      case Request::Kind::move:
        device_(NodesWork<AcceptTrial>{b});
        [[fallthrough]];
      case Request::Kind::linearize:
        if (m.splined()) device_(NodesWork<SplineFrames<false>>{b});
        device_(FramesWork<true>{b, false});
        if (m.splined()) device_(NodesWork<ReduceConstraint<false>>{b});
        fold<PointItems>(b, false, m.point_folds());
        device_(NodesWork<GatherGradient>{b});
        if (m.splined()) {
          device_(NodesWork<SplineRotations>{b});
          device_(NodesWork<ReduceGradient>{b});
        }
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
        device_(NodesWork<MeasureSteps>{b});
        fold<StepItems>(b, false, m.step_folds());
        break;
      case Request::Kind::trial:
        device_(NodesWork<ComposeStep>{b});
        evaluate_trial(b);
        break;
      case Request::Kind::correction:
        device_(NodesWork<WriteCorrectionRhs>{b});
        solver_.solve(m.correction, 1);
        device_(NodesWork<ApplyCorrection>{b});
        evaluate_trial(b);
        break;
      case Request::Kind::nothing:
        break;
    }
  }

  void evaluate_trial(const FramesBatch& b) {
    if (memory_.splined()) device_(NodesWork<SplineFrames<true>>{b});
    device_(FramesWork<false>{b, true});
    if (memory_.splined()) device_(NodesWork<ReduceConstraint<true>>{b});
    fold<PointItems>(b, true, memory_.point_folds());
  }

  template <class Items>
  void fold(const FramesBatch& b, bool tried, const Folds& f) {
    FramesMemory<Device>& m = memory_;
    device_(FoldChunksWork<Items>{b, tried, f, m.partial});
    device_(FoldRestWork{b, f, m.partial, m.device_results});
    device_.copy_out(m.results, m.device_results, b.places * f.folds * sizeof(double));
  }

  struct Recordings {
    Recording of[Request::kKinds];
    bool made[Request::kKinds] = {};
  };

  Device& device_;
  typename Device::Solver& solver_;
  FramesMemory<Device>& memory_;
  std::vector<Recordings> recordings_;  // by the binary logarithm of the places
};

}  // namespace trajopt
