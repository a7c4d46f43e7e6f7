// The launches around terms that are functions on the host: the frames on their way to them, and
// what they add to each frame. What travels is packed by place of the launch, not by problem, so
// that one copy takes it all.
#pragma once

#include "trajopt/problem/callback_rows.h"
#include "trajopt/problem/frames_system.h"

namespace trajopt {

// Device memory that the host's numbers pass through, by place.
struct CallbackStage {
  double* frames;     // places x frames_each: (N + 2) x nq
  double* residuals;  // places x residuals_each: of one term after the other N x rows
  double* jacobians;  // places x residuals_each x 3D
  long frames_each, residuals_each;
};

inline namespace TRAJOPT_ISA {

TRAJOPT_HD inline CallbackRows callback_rows(const CallbackStage& stage, const CallbackTerm& term,
                                             long place, long frame, int d) {
  const long at = place * stage.residuals_each + term.first + frame * term.rows;
  return {term.rows, term.weight, stage.residuals + at, stage.jacobians + at * 3 * d};
}

struct PackFramesWork {
  static constexpr const char* kName = "pack frames";
  static constexpr int kMaxRanks = 256;
  FramesBatch b;
  bool tried;  // those of the trial, or of the current point
  CallbackStage stage;

  TRAJOPT_HD long chunks() const { return (stage.frames_each + kMaxRanks - 1) / kMaxRanks; }
  TRAJOPT_HD long jobs() const { return b.places * chunks(); }
  TRAJOPT_HD int ranks() const { return kMaxRanks; }
  std::size_t bytes() const { return 0; }

  template <class Group>
  TRAJOPT_HD void operator()(const Group& group, long job, void*) const {
    const long place = job / chunks(), first = job % chunks() * kMaxRanks;
    const FramesSystem* s = b.system(place);
    if (s == nullptr) return;
    const double* from = s->point(tried).frames;
    double* to = stage.frames + place * stage.frames_each;
    for_each(group, kMaxRanks, [&](int rank) {
      if (first + rank < stage.frames_each) to[first + rank] = from[first + rank];
    });
  }
};

// The cost of every such term, a frame per rank.
struct CallbackCostWork {
  static constexpr const char* kName = "callback cost";
  static constexpr int kMaxRanks = 64;
  FramesBatch b;
  CallbackStage stage;

  TRAJOPT_HD long chunks() const { return (b.frames + kMaxRanks - 1) / kMaxRanks; }
  TRAJOPT_HD long jobs() const { return b.places * chunks(); }
  TRAJOPT_HD int ranks() const { return kMaxRanks; }
  std::size_t bytes() const { return 0; }

  template <class Group>
  TRAJOPT_HD void operator()(const Group& group, long job, void*) const {
    const long place = job / chunks(), first = job % chunks() * kMaxRanks;
    const FramesSystem* s = b.system(place);
    if (s == nullptr) return;
    for_each(group, kMaxRanks, [&](int rank) {
      const long f = first + rank;
      if (f >= b.frames) return;
      for (int k = 0; k < s->ncallback; ++k) {
        s->callback_cost[k * b.frames + f] =
            callback_cost(callback_rows(stage, s->callback[k], place, f, s->in.model.ndof));
      }
    });
  }
};

// Adds the derivatives of all of them to what FramesWork<true> wrote, a frame per group: for R rows
// 12 R D^2 flops, and 6 D^2 doubles read and written R times, most of them in cache.
struct CallbackDerivativesWork {
  static constexpr const char* kName = "callback derivatives";
  static constexpr int kMaxRanks = 128;
  FramesBatch b;
  CallbackStage stage;

  TRAJOPT_HD long jobs() const { return b.places * b.frames; }
  TRAJOPT_HD int ranks() const { return kMaxRanks; }
  std::size_t bytes() const { return 0; }

  template <class Group>
  TRAJOPT_HD void operator()(const Group& group, long job, void*) const {
    const long place = job / b.frames, f = job % b.frames;
    const FramesSystem* s = b.system(place);
    if (s == nullptr) return;
    const int d = s->in.model.ndof;
    for (int k = 0; k < s->ncallback; ++k) {
      add_callback_rows(group, callback_rows(stage, s->callback[k], place, f, d), d,
                        s->hessian + f * 6 * d * d, s->gradient + f * 3 * d);
    }
  }
};

}  // namespace TRAJOPT_ISA
}  // namespace trajopt
