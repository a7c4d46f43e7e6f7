// The executor of the frames formulation on a device: memory of its own, work in launches.
//
// `Device` says what memory is and how a launch is made:
//
//   Bytes allocate(std::size_t bytes)        memory of the device, with data()
//   T* pinned<T>(count)                      host memory that copies go to and from; never freed
//                                            before the device
//   upload(to, from, bytes)                  from any host memory; done when it returns
//   copy_in, copy_out(to, from, bytes)       between pinned and device memory, in order
//   operator()(work)                         a launch, in order
//   Recording record(enqueue), play(it)      launches and copies recorded once; play waits
//   name()                                   what a user calls it
//   Solver(device, blocks, size, ordering, signs)   of the KKT matrix at diagonal() and lower(),
//     which begins as zeros: factor(), solve(x, m), reserve(m) and refine(rhs, x, m, steps,
//     tolerance) are launches; failure() says why the last factorization failed, or is nullptr
//
// The CUDA device is in cuda/trajopt/cuda/solver; tests have one that runs every launch on the
// processor. Both give the bits of the processor's executor for the same elimination order.
#pragma once

#include <algorithm>
#include <cstring>
#include <utility>

#include "trajopt/problem/frames_work.h"
#include "trajopt/problem/kkt_system.h"
#include "trajopt/solver/executor.h"
#include "trajopt/solver/stopwatch.h"

namespace trajopt {

// Throws DeviceError, naming what of the problem a device cannot work on; says nothing otherwise.
void require_device_support(const TrajectoryProblem& problem, const std::string& device);

template <class Device>
class FramesExecutor final : public SqpExecutor {
 public:
  static constexpr int kMostLanes = 1 << 14;  // frames in work at once: some waves of an H200

  FramesExecutor(Device device, const TrajectoryProblem& problem, const ExecutorOptions& options,
                 State& state, int most_lanes = kMostLanes)
      : device_(checked(std::move(device), problem)),
        state_(state),
        signs_(make_signs(problem)),
        solver_(device_, (problem.nodes() + 1) / 2, 2 * (problem.primal() + problem.dual()),
                options.ordering, signs_) {
    place(problem, options, std::min(most_lanes, problem.frame_count()));
    record();
    upload(s_.current.frames + 2L * s_.in.model.nq, state.data(), state.size());
  }

  PointValues linearize() override {
    watch_.lap();
    device_.play(linearize_);
    terms_.assign(results_, results_ + s_.terms());
    seconds_.dynamics += watch_.lap();
    return point_values();
  }

  const std::vector<double>& terms() const override { return terms_; }

  const State& state() override {
    if (moved_) {
      device_.play(read_state_);
      std::copy_n(host_state_, state_.size(), state_.begin());
      moved_ = false;
    }
    return state_;
  }

  // One sequence of launches up to the steps' numbers: nothing of it is worth an answer before.
  bool factor(double damping) override {
    watch_.lap();
    controls_->damping = damping;
    device_.play(solve_);
    std::copy_n(results_, kStepItems, steps_.item);
    const std::string* failure = solver_.failure();
    if (failure != nullptr) error_ = *failure;
    seconds_.factorization += watch_.lap();
    return failure == nullptr;
  }

  const std::string& error() const override { return error_; }
  StepValues solve_steps() override { return steps_; }

  PointValues try_step(double ct, double cn) override {
    watch_.lap();
    controls_->tangential = ct;
    controls_->normal = cn;
    at_ = 0;
    device_.play(try_step_);
    seconds_.dynamics += watch_.lap();
    return point_values();
  }

  PointValues try_correction(double zeta) override {
    watch_.lap();
    controls_->zeta = zeta;
    device_.play(try_correction_[at_]);
    at_ = 1 - at_;
    seconds_.dynamics += watch_.lap();
    return point_values();
  }

  void undo_correction() override { at_ = 1 - at_; }

  void accept() override {
    device_.play(accept_[at_]);
    moved_ = true;
  }

  // The solution of the steps counts as factorization, a correction with its trial as dynamics.
  PhaseSeconds take_seconds() override { return std::exchange(seconds_, {}); }
  std::string device() const override { return device_.name(); }

 private:
  static Device checked(Device device, const TrajectoryProblem& problem) {
    require_device_support(problem, device.name());
    return device;
  }

  static std::vector<signed char> make_signs(const TrajectoryProblem& problem) {
    const int width = problem.primal() + problem.dual(), nodes = problem.nodes();
    std::vector<signed char> signs(static_cast<std::size_t>(nodes + nodes % 2) * width, 1);
    for (int i = 0; i < nodes; ++i)
      std::fill_n(signs.begin() + static_cast<long>(i) * width, problem.dual(), -1);
    return signs;
  }

  template <class T>
  T* allocate(std::size_t count) {
    buffers_.push_back(device_.allocate(count * sizeof(T)));
    return reinterpret_cast<T*>(buffers_.back().data());
  }
  template <class T>
  void upload(T* to, const T* from, std::size_t count) {
    if (count > 0) device_.upload(to, from, count * sizeof(T));
  }
  // A copy of `count` host values; nullptr stays nullptr.
  template <class T>
  T* copy(const T* from, std::size_t count) {
    if (from == nullptr) return nullptr;
    T* to = allocate<T>(count);
    upload(to, from, count);
    return to;
  }

  ModelView copy_model(const ModelView& m) {
    static_assert(sizeof(ModelView) == 8 * sizeof(int) + sizeof(double) + 10 * sizeof(void*),
                  "a new member has to be copied here");
    ModelView v = m;
    v.joints = copy(m.joints, m.njoint);
    v.dof_joint = copy(m.dof_joint, m.ndof);
    v.dof_parent = copy(m.dof_parent, m.ndof);
    v.lower = copy(m.lower, m.ndof);
    v.upper = copy(m.upper, m.ndof);
    v.actuated = copy(m.actuated, m.nactuated);
    v.unactuated = copy(m.unactuated, m.nunactuated);
    v.points = copy(m.points, m.npoint);
    v.spheres = copy(m.spheres, m.nsphere);
    v.pairs = copy(m.pairs, m.npair);
    return v;
  }

  FrameInput copy_input(const TrajectoryProblem& p, double augmentation) {
    const std::size_t n = p.frame_count();
    std::vector<DenseTerm> terms = p.dense_terms();
    for (DenseTerm& t : terms) {
      t.scale = copy(t.scale, n);
      t.target = copy(t.target, 3 * n);
    }
    return {copy_model(view(p.model())),
            copy(&p.physics(), 1),
            copy(p.stencils().data(), n),
            copy(p.dt().data(), n + 1),
            nullptr,
            copy(terms.data(), terms.size()),
            static_cast<int>(terms.size()),
            augmentation};
  }

  const LocalTerm* copy_local(const TrajectoryProblem& p) {
    const std::size_t n = p.frame_count();
    std::vector<LocalTerm> terms = p.local_terms();
    for (LocalTerm& t : terms) {
      t.weight = copy(t.weight, n);
      t.dof_weight = copy(t.dof_weight, p.model().ndof);
      t.target = copy(t.target, n * (t.kind == LocalKind::pose ? p.model().nq : p.model().ndof));
    }
    return copy(terms.data(), terms.size());
  }

  FramesPoint make_point(const TrajectoryProblem& p) {
    const std::size_t n = p.frame_count(), nq = p.model().nq;
    const FramesPoint at{allocate<double>((n + 2) * nq), allocate<double>(n * p.primal()),
                         allocate<double>(n * p.dual())};
    upload(at.frames, p.initial().data(), 2 * nq);
    return at;
  }

  void place(const TrajectoryProblem& p, const ExecutorOptions& options, int lanes) {
    const std::size_t n = p.frame_count(), d = p.primal(), m = p.dual();
    s_.frame_count = p.frame_count();
    s_.in = copy_input(p, options.augmentation);
    s_.local = copy_local(p);
    s_.nlocal = static_cast<int>(p.local_terms().size());
    s_.smoothing = options.smoothing;
    s_.epsilon = options.epsilon;
    s_.current = make_point(p);
    for (FramesPoint& t : s_.trial) t = make_point(p);
    s_.in.frames = s_.current.frames;
    s_.hessian = allocate<double>(n * 6 * d * d);
    s_.gradient = allocate<double>(n * 3 * d);
    s_.jacobian = allocate<double>(n * 3 * m * d);
    s_.torque = allocate<double>(n * p.model().actuated.size());
    s_.cost = allocate<double>(n * s_.in.nterm);
    s_.local_cost = allocate<double>(n * s_.nlocal);
    s_.node_gradient = allocate<double>(n * d);
    s_.diagonal = solver_.diagonal();
    s_.lower = solver_.lower();
    s_.rhs = allocate<double>(2 * s_.rows());
    s_.steps = allocate<double>(2 * s_.rows());
    s_.correction = allocate<double>(s_.rows());
    s_.items = allocate<double>(kStepItems * n);
    s_.lanes = lanes;
    // Whole cache lines, so that neighbouring frames share none.
    s_.scratch_bytes =
        (frame_scratch_bytes<double>(p.frame_input(nullptr, options.augmentation)) + 127) / 128 *
        128;
    s_.scratch = allocate<unsigned char>(lanes * s_.scratch_bytes);
    const std::size_t most = std::max<std::size_t>(s_.terms() + 1, kStepItems);
    partial_ = allocate<double>(most * tree_chunks(s_.frame_count));
    device_results_ = allocate<double>(most);
    results_ = device_.template pinned<double>(most);
    s_.controls = device_controls_ = allocate<Controls>(1);
    controls_ = device_.template pinned<Controls>(1);
    *controls_ = {};
    host_state_ = device_.template pinned<double>(state_.size());
  }

  template <class Items>
  void fold(const Items& items) {
    const int folds = items.folds();
    device_(FoldChunksWork<Items>{items, s_.frames(), partial_});
    device_(FoldRestWork{folds, tree_chunks(s_.frames()), partial_, device_results_});
    device_.copy_out(results_, device_results_, folds * sizeof(double));
  }
  template <class Body>
  void each_node(const Body& body) {
    device_(NodesWork<Body>{s_, body});
  }
  void evaluate(const FramesPoint& at) {
    device_(FramesWork<false>{s_, at});
    fold(PointItems(s_, at));
  }
  void read_controls() { device_.copy_in(device_controls_, controls_, sizeof(Controls)); }

  void record() {
    linearize_ = device_.record([&] {
      device_(FramesWork<true>{s_, s_.current});
      fold(PointItems(s_, s_.current));
      each_node(GatherGradient{});
    });
    solver_.reserve(2);
    solve_ = device_.record([&] {
      read_controls();
      device_(AssembleWork{s_});
      solver_.factor();
      each_node(RemoveEpsilon{});
      each_node(WriteStepsRhs{});
      solver_.solve(s_.steps, 2);
      solver_.refine(s_.rhs, s_.steps, 2, KktSystem::kRefinements, KktSystem::kRefineTolerance);
      each_node(MeasureSteps{});
      fold(StepItems{s_.items, s_.frames()});
    });
    try_step_ = device_.record([&] {
      read_controls();
      each_node(ComposeStep{});
      evaluate(s_.trial[0]);
    });
    for (int from = 0; from < 2; ++from) {
      try_correction_[from] = device_.record([&] {
        read_controls();
        each_node(WriteCorrectionRhs{from});
        solver_.solve(s_.correction, 1);
        each_node(ApplyCorrection{from});
        evaluate(s_.trial[1 - from]);
      });
      accept_[from] = device_.record([&] { each_node(AcceptTrial{from}); });
    }
    read_state_ = device_.record([&] {
      device_.copy_out(host_state_, s_.current.frames + 2L * s_.in.model.nq,
                       state_.size() * sizeof(double));
    });
  }

  // From the folds of PointItems.
  PointValues point_values() const {
    PointValues v;
    for (int k = 0; k < s_.terms(); ++k) v.objective += results_[k];
    v.constraint_norm = v.frame_violation = results_[s_.terms()];
    return v;
  }

  using Bytes = decltype(std::declval<Device>().allocate(0));
  using Recording = typename Device::Recording;

  Device device_;
  State& state_;
  const std::vector<signed char> signs_;
  typename Device::Solver solver_;
  std::vector<Bytes> buffers_;
  FramesSystem s_{};
  double *partial_ = nullptr, *device_results_ = nullptr;
  Controls* device_controls_ = nullptr;
  double* results_ = nullptr;  // pinned
  Controls* controls_ = nullptr;
  double* host_state_ = nullptr;
  Recording linearize_, solve_, try_step_, try_correction_[2], accept_[2], read_state_;
  std::vector<double> terms_;
  StepValues steps_{};
  int at_ = 0;  // which trial
  bool moved_ = false;
  Stopwatch watch_;
  PhaseSeconds seconds_;
  std::string error_;
};

}  // namespace trajopt
