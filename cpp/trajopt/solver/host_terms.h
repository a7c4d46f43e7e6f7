// Terms that are functions on the host (CallbackObjective): the memory through which a device hands
// out its frames and gets back residuals and their derivatives, and the calls themselves.
#pragma once

#include <algorithm>
#include <exception>
#include <utility>
#include <vector>

#include "trajopt/problem/callback_work.h"
#include "trajopt/solver/executor.h"

namespace trajopt {

template <class Device>
class HostTerms {
 public:
  HostTerms(Device& device, const std::vector<BatchMember>& members) {
    for (const BatchMember& m : members) problems_.push_back(m.problem);
    const TrajectoryProblem& one = *problems_[0];
    if (!any()) return;
    const long n = one.frame_count(), count = static_cast<long>(problems_.size());
    derivatives_ = 3L * one.model().ndof;
    stage_.frames_each = (n + 2) * one.model().nq;
    for (const TrajectoryProblem* p : problems_) {
      long rows = 0;
      for (const CallbackObjective& term : p->objective().callbacks) rows += term.rows;
      stage_.residuals_each = std::max(stage_.residuals_each, n * rows);
    }
    const long frames = count * stage_.frames_each, residuals = count * stage_.residuals_each;
    const auto allocate = [&](long values) {
      buffers_.push_back(device.allocate(values * sizeof(double)));
      return reinterpret_cast<double*>(buffers_.back().data());
    };
    stage_.frames = allocate(frames);
    stage_.residuals = allocate(residuals);
    stage_.jacobians = allocate(residuals * derivatives_);
    frames_ = device.template pinned<double>(frames);
    residuals_ = device.template pinned<double>(residuals);
    jacobians_ = device.template pinned<double>(residuals * derivatives_);
  }

  bool any() const { return !problems_[0]->objective().callbacks.empty(); }

  // The frames of every place to the host.
  void fetch_frames(const Device& device, const FramesBatch& b, bool tried) const {
    device(PackFramesWork{b, tried, stage_});
    device.copy_out(frames_, stage_.frames, b.places * stage_.frames_each * sizeof(double));
  }
  // What evaluate() found to the device: each term's cost,
  void add_costs(const Device& device, const FramesBatch& b) const {
    const std::size_t bytes = b.places * stage_.residuals_each * sizeof(double);
    device.copy_in(stage_.residuals, residuals_, bytes);
    device(CallbackCostWork{b, stage_});
  }
  // and its derivatives, to be called after add_costs() and FramesWork<true>.
  void add_derivatives(const Device& device, const FramesBatch& b) const {
    const std::size_t values = b.places * stage_.residuals_each * derivatives_;
    device.copy_in(stage_.jacobians, jacobians_, values * sizeof(double));
    device(CallbackDerivativesWork{b, stage_});
  }

  // Calls the functions of these problems, in the order of the places; what one throws is the
  // answer to its problem. False: there is no other answer.
  bool evaluate(const std::vector<int>& problems, bool derivatives, std::vector<Answer>& answers) {
    bool good = false;
    for (std::size_t place = 0; place < problems.size(); ++place) {
      const int p = problems[place];
      try {
        evaluate_at(static_cast<long>(place), *problems_[p], derivatives);
        good = true;
      } catch (...) {
        answers[p].error = std::current_exception();
      }
    }
    return good;
  }

 private:
  using Bytes = decltype(std::declval<Device>().allocate(0));

  void evaluate_at(long place, const TrajectoryProblem& problem, bool derivatives) {
    const double* frames = frames_ + place * stage_.frames_each;
    long at = place * stage_.residuals_each;
    for (const CallbackObjective& term : problem.objective().callbacks) {
      term.evaluate(frames, residuals_ + at,
                    derivatives ? jacobians_ + at * derivatives_ : nullptr);
      at += static_cast<long>(problem.frame_count()) * term.rows;
    }
  }

  std::vector<TrajectoryProblem*> problems_;
  CallbackStage stage_{};
  long derivatives_ = 0;  // of a residual: 3D
  std::vector<Bytes> buffers_;
  double *frames_ = nullptr, *residuals_ = nullptr, *jacobians_ = nullptr;  // pinned
};

}  // namespace trajopt
