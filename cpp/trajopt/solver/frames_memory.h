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
    first_state_ = 2L * one.model().nq;
    frames_each_ = (one.frame_count() + 2L) * one.model().nq;
    place_frames(members, systems);
    place_vectors(one, systems);
    place_matrices(one, systems, kkt);
    place_controls(systems);
    place_batch(systems, rank_scratch_bytes(members, options.augmentation), most_lanes);
  }

  int count() const { return count_; }
  int terms() const { return terms_; }
  // Values of a problem at a time on the way to the host, at most.
  int most_results() const { return std::max<int>(terms_ + 1, kStepItems); }
  const FramesBatch& batch() const { return batch_; }

  // Where the current point of a problem has its state.
  const double* state(int problem) const { return frames_ + problem * frames_each_ + first_state_; }

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
    Parcel measured(nullptr);
    fill(measured);
    unsigned char* base = allocate<unsigned char>(measured.size());
    Parcel parcel(base);
    fill(parcel);
    device_.upload(base, parcel.data(), parcel.size());
    terms_ = systems[0].terms();
    return systems;
  }

  // Frames -1 and 0 of every problem, and its start: of the current point and both trials.
  void place_frames(const std::vector<BatchMember>& members, std::vector<FramesSystem>& systems) {
    std::vector<double> values, one;
    for (const BatchMember& m : members) {
      m.problem->frames_of(*m.state, one);
      values.insert(values.end(), one.begin(), one.end());
    }
    for (int k = 0; k < 3; ++k) {
      const Rows frames(*this, frames_each_);
      device_.upload(frames.of(0), values.data(), values.size() * sizeof(double));
      if (k == 0) frames_ = frames.of(0);
      for (int p = 0; p < count_; ++p)
        (k == 0 ? systems[p].current : systems[p].trial[k - 1]).frames = frames.of(p);
    }
    for (FramesSystem& s : systems) s.in.frames = s.current.frames;
  }

  // What belongs to a point, to the steps and to the sums.
  void place_vectors(const TrajectoryProblem& one, std::vector<FramesSystem>& systems) {
    const std::size_t n = one.frame_count(), d = one.primal(), m = one.dual();
    const std::size_t rows = systems[0].rows();
    const Rows rhs_rows(*this, 2 * rows), steps_rows(*this, 2 * rows), corrections(*this, rows);
    const Rows items(*this, kStepItems * n);
    const Rows step0(*this, n * d), step1(*this, n * d);
    const Rows at0(*this, n * m), at1(*this, n * m), at2(*this, n * m);
    for (std::size_t p = 0; p < systems.size(); ++p) {
      FramesSystem& s = systems[p];
      s.current.step = nullptr;  // nothing led there
      s.trial[0].step = step0.of(p);
      s.trial[1].step = step1.of(p);
      s.current.constraint = at0.of(p);
      s.trial[0].constraint = at1.of(p);
      s.trial[1].constraint = at2.of(p);
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
    const std::size_t n = one.frame_count(), d = one.primal(), m = one.dual();
    const std::size_t chain = systems[0].blocks() - (systems[0].ring ? 1 : 0);
    const std::size_t size = systems[0].size(), square = size * size;
    const Rows hessian(*this, n * 6 * d * d), gradient(*this, n * 3 * d);
    const Rows jacobian(*this, n * 3 * m * d), node_gradient(*this, n * d);
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
      s.node_gradient = node_gradient.of(p);
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
    batch_.lanes = std::min<long>(most_lanes, batch_.frames * count_);
    batch_.scratch_bytes = scratch_bytes;
    batch_.scratch = allocate<unsigned char>(batch_.lanes * batch_.scratch_bytes);
    const std::size_t each = most_results();
    partial = allocate<double>(count_ * each * tree_chunks(batch_.frames));
    device_results = allocate<double>(count_ * each);
    results = device_.template pinned<double>(count_ * each);
  }

  Device& device_;
  const int count_;
  std::vector<Bytes> buffers_;
  FramesBatch batch_{};
  int terms_ = 0;
  std::size_t first_state_ = 0, frames_each_ = 0;
  double* frames_ = nullptr;  // of the current points
};

}  // namespace trajopt
