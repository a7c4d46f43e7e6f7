// The memory that FramesExecutor works in: where the numbers of every problem lie on the device,
// and the pinned memory that requests and answers go through.
#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include "trajopt/solver/frames_packing.h"

namespace trajopt {

// The KKT matrices of all problems, on the device, as in FramesSystem.
struct KktArrays {
  double *diagonal, *lower;
  double *border, *corner;  // of rings
};

template <class Device>
class FramesMemory {
 public:
  FramesMemory(Device& device, const std::vector<BatchMember>& members,
               const ExecutorOptions& options, int most_lanes, const KktArrays& kkt)
      : device_(device), count_(static_cast<int>(members.size())) {
    std::vector<FramesSystem> systems = pack(members, options);
    const TrajectoryProblem& one = *members[0].problem;
    splined_ = systems[0].splined();
    frames_each_ = (one.frame_count() + 2L) * one.model().nq;
    place_points(members, systems);
    place_vectors(one, systems);
    place_matrices(one, systems, kkt);
    place_controls(systems);
    place_batch(systems, rank_scratch_bytes(members, options.augmentation), most_lanes);
  }

  int count() const { return count_; }
  int terms() const { return terms_; }
  bool splined() const { return splined_; }
  // What is folded of a point and of the steps: sums of the terms, and of all items before the
  // multipliers.
  Folds point_folds() const { return {batch_.frames, terms_ + (splined_ ? 2 : 1), terms_}; }
  Folds step_folds() const { return {batch_.nodes, kStepItems, kMultiplier}; }
  const FramesBatch& batch() const { return batch_; }

  // Where the current point of a problem has its state.
  const double* state(int problem) const { return states_ + problem * state_stride_; }

  // On the device, of all problems.
  double *rhs = nullptr, *steps = nullptr, *correction = nullptr;
  double *partial = nullptr, *device_results = nullptr;
  Controls* device_controls = nullptr;
  int* device_active = nullptr;
  // Pinned.
  double* results = nullptr;
  Controls* controls = nullptr;
  int *active = nullptr, *failed = nullptr;

 private:
  using Bytes = decltype(std::declval<Device>().allocate(0));

  template <class T>
  T* allocate(std::size_t count) {
    buffers_.push_back(device_.allocate(count * sizeof(T)));
    return reinterpret_cast<T*>(buffers_.back().data());
  }

  // An array of every problem, one behind the other.
  class Rows {
   public:
    Rows(FramesMemory& memory, std::size_t each)
        : each_(each), data_(memory.template allocate<double>(each * memory.count_)) {}
    double* of(std::size_t problem) const { return data_ + problem * each_; }

   private:
    std::size_t each_;
    double* data_;
  };

  // What of the problems is given, in device memory.
  std::vector<FramesSystem> pack(const std::vector<BatchMember>& members,
                                 const ExecutorOptions& options) {
    std::vector<FramesSystem> systems(count_);
    const auto fill = [&](Parcel& parcel) {
      for (int p = 0; p < count_; ++p)
        pack_problem(parcel, *members[p].problem, options, systems[p]);
    };
    Parcel parcel;
    fill(parcel);
    unsigned char* base = allocate<unsigned char>(parcel.size());
    parcel.address(base);
    fill(parcel);
    device_.upload(base, parcel.data(), parcel.size());
    terms_ = systems[0].terms();
    return systems;
  }

  // Frames of every problem, and its start: of the current point and both trials. The frames of a
  // spline but for the first two are computed.
  void place_points(const std::vector<BatchMember>& members, std::vector<FramesSystem>& systems) {
    const std::size_t given = 2L * members[0].problem->model().nq;
    const std::size_t knots_each = splined_ ? members[0].state->size() : 0;
    std::vector<double> frames, knots, one;
    for (const BatchMember& m : members) {
      m.problem->frames_of(*m.state, one);
      frames.insert(frames.end(), one.begin(), one.end());
      if (splined_) knots.insert(knots.end(), m.state->begin(), m.state->end());
    }
    for (int k = 0; k < 3; ++k) {
      const Rows frame_rows(*this, frames_each_), knot_rows(*this, knots_each);
      device_.upload(frame_rows.of(0), frames.data(), frames.size() * sizeof(double));
      device_.upload(knot_rows.of(0), knots.data(), knots.size() * sizeof(double));
      for (int p = 0; p < count_; ++p) {
        FramesPoint& point = k == 0 ? systems[p].current : systems[p].trial[k - 1];
        point.frames = frame_rows.of(p);
        point.knots = knot_rows.of(p);
      }
    }
    for (FramesSystem& s : systems) s.in.frames = s.current.frames;
    states_ = splined_ ? systems[0].current.knots : systems[0].current.frames + given;
    state_stride_ = splined_ ? knots_each : frames_each_;
  }

  // What belongs to a point, to the steps and to the sums.
  void place_vectors(const TrajectoryProblem& one, std::vector<FramesSystem>& systems) {
    const std::size_t nodes = one.nodes(), rows = systems[0].rows();
    const Rows rhs_rows(*this, 2 * rows), steps_rows(*this, 2 * rows), corrections(*this, rows);
    const Rows items(*this, kStepItems * nodes);
    const Rows step0(*this, nodes * one.primal()), step1(*this, nodes * one.primal());
    const std::size_t constraints = one.frame_count() * one.model().unactuated.size();
    for (int k = 0; k < 3; ++k) {
      const Rows by_frame(*this, constraints);
      const Rows by_node(*this, splined_ ? nodes * one.dual() : 0);
      for (std::size_t p = 0; p < systems.size(); ++p) {
        FramesPoint& point = k == 0 ? systems[p].current : systems[p].trial[k - 1];
        point.frame_constraint = by_frame.of(p);
        point.constraint = splined_ ? by_node.of(p) : by_frame.of(p);
      }
    }
    for (std::size_t p = 0; p < systems.size(); ++p) {
      FramesSystem& s = systems[p];
      s.current.step = nullptr;  // nothing led there
      s.trial[0].step = step0.of(p);
      s.trial[1].step = step1.of(p);
      s.rhs = rhs_rows.of(p);
      s.steps = steps_rows.of(p);
      s.correction = corrections.of(p);
      s.items = items.of(p);
    }
    rhs = systems[0].rhs;
    steps = systems[0].steps;
    correction = systems[0].correction;
  }

  // The linearization and the KKT matrix.
  void place_matrices(const TrajectoryProblem& one, std::vector<FramesSystem>& systems,
                      const KktArrays& kkt) {
    const std::size_t n = one.frame_count(), d = one.model().ndof;
    const std::size_t m = one.model().unactuated.size();
    const std::size_t chain = systems[0].blocks() - (systems[0].ring ? 1 : 0);
    const std::size_t size = systems[0].size(), square = size * size;
    const Rows hessian(*this, n * 6 * d * d), gradient(*this, n * 3 * d);
    const Rows jacobian(*this, n * 3 * m * d), frame_gradient(*this, n * d);
    const Rows node_gradient(*this, splined_ ? one.nodes() * one.primal() : 0);
    const Rows rotations(*this, n * 36 * systems[0].spline.balls);
    const Rows cost(*this, n * systems[0].in.nterm), local_cost(*this, n * systems[0].nlocal);
    const Rows callback_cost(*this, n * systems[0].ncallback);
    const Rows torque(*this, n * one.model().actuated.size());
    for (std::size_t p = 0; p < systems.size(); ++p) {
      FramesSystem& s = systems[p];
      s.hessian = hessian.of(p);
      s.gradient = gradient.of(p);
      s.jacobian = jacobian.of(p);
      s.torque = torque.of(p);
      s.cost = cost.of(p);
      s.local_cost = local_cost.of(p);
      s.callback_cost = callback_cost.of(p);
      s.frame_gradient = frame_gradient.of(p);
      s.node_gradient = splined_ ? node_gradient.of(p) : frame_gradient.of(p);
      s.rotations = rotations.of(p);
      s.spline.rotations = s.rotations;
      s.diagonal = kkt.diagonal + p * chain * square;
      s.lower = kkt.lower + p * (chain - 1) * square;
      s.border = s.ring ? kkt.border + p * chain * square : nullptr;
      s.corner = s.ring ? kkt.corner + p * square : nullptr;
    }
  }

  void place_controls(std::vector<FramesSystem>& systems) {
    device_controls = allocate<Controls>(count_);
    for (std::size_t p = 0; p < systems.size(); ++p) systems[p].controls = device_controls + p;
    controls = device_.template pinned<Controls>(count_);
    std::fill_n(controls, count_, Controls{});
    active = device_.template pinned<int>(count_ + 1);
    failed = device_.template pinned<int>(count_);
  }

  void place_batch(const std::vector<FramesSystem>& systems, std::size_t scratch_bytes,
                   int most_lanes) {
    FramesSystem* device_systems = allocate<FramesSystem>(systems.size());
    device_.upload(device_systems, systems.data(), systems.size() * sizeof(FramesSystem));
    batch_.systems = device_systems;
    batch_.active = device_active = allocate<int>(count_ + 1);
    batch_.frames = systems[0].frames();
    batch_.nodes = systems[0].nodes();
    batch_.lanes = std::min<long>(most_lanes, batch_.frames * count_);
    batch_.scratch_bytes = scratch_bytes;
    batch_.scratch = allocate<unsigned char>(batch_.lanes * batch_.scratch_bytes);
    const std::size_t row_scratch = splined_ ? spline_row_scratch(systems[0].dofs()) : 0;
    batch_.row_scratch = allocate<double>(count_ * batch_.blocks() * row_scratch);
    const std::size_t each = std::max(point_folds().folds, step_folds().folds);
    partial = allocate<double>(count_ * each * tree_chunks(batch_.frames));
    device_results = allocate<double>(count_ * each);
    results = device_.template pinned<double>(count_ * each);
  }

  Device& device_;
  const int count_;
  std::vector<Bytes> buffers_;
  FramesBatch batch_{};
  int terms_ = 0;
  bool splined_ = false;
  std::size_t frames_each_ = 0, state_stride_ = 0;
  const double* states_ = nullptr;  // of the current points
};

}  // namespace trajopt
