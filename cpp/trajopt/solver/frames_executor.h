// The executor of the frames formulation on a device: memory of its own, work in launches, many
// problems of one shape at once. A single problem is a batch of one.
//
// `Device` says what memory is and how a launch is made:
//
//   Bytes allocate(std::size_t bytes)        memory of the device, with data()
//   T* pinned<T>(count)                      host memory that copies go to and from; never freed
//                                            before the device
//   upload, download(to, from, bytes)        to and from any host memory; done when they return
//   copy_in, copy_out(to, from, bytes)       between pinned and device memory, in order
//   operator()(work)                         a launch, in order
//   Recording record(enqueue), play(it)      launches and copies recorded once; play waits
//   name()                                   what a user calls it
//   Solver(device, blocks, size, ordering, signs, batch)   of the KKT matrices at diagonal() and
//     lower(), which begin as zeros. After list(listed, places) factor(), solve(x, m), reserve(m)
//     and refine(rhs, x, m, steps, tolerance) are launches for listed[0] problems, those in
//     listed[1] on. failed(), in device memory, holds kNever or anything else by problem;
//     failure(problem) then says why
//
// The CUDA device is in cuda/trajopt/cuda/solver; tests have one that runs every launch on the
// processor. Both give the bits of the processor's executor for the same elimination order.
#pragma once

#include <algorithm>
#include <bit>
#include <cstring>
#include <utility>

#include "trajopt/linalg/group_system.h"
#include "trajopt/problem/frames_work.h"
#include "trajopt/problem/kkt_system.h"
#include "trajopt/solver/executor.h"
#include "trajopt/solver/parcel.h"
#include "trajopt/solver/stopwatch.h"

namespace trajopt {

// Throws DeviceError, naming what of the problem a device cannot work on; says nothing otherwise.
void require_device_support(const TrajectoryProblem& problem, const std::string& device);

template <class Device>
class FramesExecutor final : public BatchExecutor {
 public:
  static constexpr int kMostLanes = 1 << 14;  // frames in work at once: some waves of an H200

  // The members must have the same shape; at least one.
  FramesExecutor(Device device, const std::vector<BatchMember>& members,
                 const ExecutorOptions& options, int most_lanes = kMostLanes)
      : device_(checked(std::move(device), members)),
        count_(static_cast<int>(members.size())),
        solver_(device_, (members[0].problem->nodes() + 1) / 2,
                2 * (members[0].problem->primal() + members[0].problem->dual()), options.ordering,
                make_signs(*members[0].problem), count_) {
    points_.reserve(count_);
    for (const BatchMember& m : members) points_.emplace_back(*this, *m.state);
    place(members, options, most_lanes);
    solver_.reserve(2);
  }

  int size() const override { return count_; }
  SqpPoint& point(int problem) override { return points_[problem]; }

  void answer(Request::Kind kind, const std::vector<int>& problems,
              const std::vector<Request>& requests, std::vector<Answer>& answers) override {
    if (problems.empty() || kind == Request::Kind::nothing) return;
    watch_.lap();
    active_[0] = static_cast<int>(problems.size());
    std::copy(problems.begin(), problems.end(), active_ + 1);
    for (int p : problems) control(p, kind, requests[p]);
    device_.play(recording(kind, problems.size()));
    const int values = kind == Request::Kind::steps ? kStepItems : terms_ + 1;
    for (std::size_t place = 0; place < problems.size(); ++place)
      read(problems[place], kind, results_ + place * values, answers[problems[place]]);
    // What was computed together is shared out evenly.
    const double each = watch_.lap() / static_cast<double>(problems.size());
    for (int p : problems) {
      PhaseSeconds& seconds = points_[p].seconds;
      (kind == Request::Kind::steps ? seconds.factorization : seconds.dynamics) += each;
    }
  }

 private:
  struct Point final : SqpPoint {
    Point(FramesExecutor& executor, State& at) : owner(executor), host(at) {}

    const std::vector<double>& terms() const override { return values; }
    const State& state() override {
      if (moved) owner.read_state(*this);
      moved = false;
      return host;
    }
    const std::string& error() const override { return text; }
    void undo_correction() override { trial = 1 - trial; }
    // The solution of the steps counts as factorization, a correction with its trial as dynamics.
    PhaseSeconds take_seconds() override { return std::exchange(seconds, {}); }

    FramesExecutor& owner;
    State& host;
    std::vector<double> values;
    std::string text;
    PhaseSeconds seconds;
    int trial = 0;
    bool moved = false;
  };

  static Device checked(Device device, const std::vector<BatchMember>& members) {
    for (const BatchMember& m : members) require_device_support(*m.problem, device.name());
    return device;
  }

  static std::vector<signed char> make_signs(const TrajectoryProblem& problem) {
    const int width = problem.primal() + problem.dual(), nodes = problem.nodes();
    std::vector<signed char> signs(static_cast<std::size_t>(nodes + nodes % 2) * width, 1);
    for (int i = 0; i < nodes; ++i)
      std::fill_n(signs.begin() + static_cast<long>(i) * width, problem.dual(), -1);
    return signs;
  }

  // What the launches are to know of a request.
  void control(int p, Request::Kind kind, const Request& r) {
    Controls& c = controls_[p];
    Point& point = points_[p];
    switch (kind) {
      case Request::Kind::steps:
        c.damping = r.damping;
        break;
      case Request::Kind::trial:
        c.tangential = r.tangential;
        c.normal = r.normal;
        point.trial = 0;
        break;
      case Request::Kind::correction:
        c.zeta = r.zeta;
        c.from = point.trial;
        point.trial = 1 - point.trial;
        break;
      case Request::Kind::move:
        point.moved = true;
        break;
      default:
        break;
    }
    c.to = point.trial;
  }

  // What the launches found.
  void read(int p, Request::Kind kind, const double* values, Answer& a) {
    Point& point = points_[p];
    a = {};
    if (kind == Request::Kind::steps) {
      std::copy_n(values, kStepItems, a.steps.item);
      a.factored = failed_[p] == linalg::GroupSystem::kNever;
      if (!a.factored) point.text = solver_.failure(p);
      return;
    }
    for (int k = 0; k < terms_; ++k) a.point.objective += values[k];
    a.point.constraint_norm = a.point.frame_violation = values[terms_];
    if (kind == Request::Kind::linearize || kind == Request::Kind::move)
      point.values.assign(values, values + terms_);
  }

  void read_state(Point& point) {
    const std::size_t p = static_cast<std::size_t>(&point - points_.data());
    device_.download(point.host.data(), frames_ + p * frames_each_ + first_state_,
                     point.host.size() * sizeof(double));
  }

  // Memory -------------------------------------------------------------------------------------

  template <class T>
  T* allocate(std::size_t count) {
    buffers_.push_back(device_.allocate(count * sizeof(T)));
    return reinterpret_cast<T*>(buffers_.back().data());
  }

  // An array of every problem, one behind the other.
  class Rows {
   public:
    Rows(FramesExecutor& executor, std::size_t each)
        : each_(each), data_(executor.template allocate<double>(each * executor.count_)) {}
    double* of(std::size_t problem) const { return data_ + problem * each_; }

   private:
    std::size_t each_;
    double* data_;
  };

  static ModelView pack_model(Parcel& parcel, const ModelView& m) {
    static_assert(sizeof(ModelView) == 8 * sizeof(int) + sizeof(double) + 10 * sizeof(void*),
                  "a new member has to be copied here");
    ModelView v = m;
    v.joints = parcel.add(m.joints, m.njoint);
    v.dof_joint = parcel.add(m.dof_joint, m.ndof);
    v.dof_parent = parcel.add(m.dof_parent, m.ndof);
    v.lower = parcel.add(m.lower, m.ndof);
    v.upper = parcel.add(m.upper, m.ndof);
    v.actuated = parcel.add(m.actuated, m.nactuated);
    v.unactuated = parcel.add(m.unactuated, m.nunactuated);
    v.points = parcel.add(m.points, m.npoint);
    v.spheres = parcel.add(m.spheres, m.nsphere);
    v.pairs = parcel.add(m.pairs, m.npair);
    return v;
  }

  static FrameInput pack_input(Parcel& parcel, const TrajectoryProblem& p, double augmentation) {
    const std::size_t n = p.frame_count();
    std::vector<DenseTerm> terms = p.dense_terms();
    for (DenseTerm& t : terms) {
      t.scale = parcel.add(t.scale, n);
      t.target = parcel.add(t.target, 3 * n);
    }
    return {pack_model(parcel, view(p.model())),
            parcel.add(&p.physics(), 1),
            parcel.add(p.stencils().data(), n),
            parcel.add(p.dt().data(), n + 1),
            nullptr,
            parcel.add(terms.data(), terms.size()),
            static_cast<int>(terms.size()),
            augmentation};
  }

  static const LocalTerm* pack_local(Parcel& parcel, const TrajectoryProblem& p) {
    const std::size_t n = p.frame_count();
    std::vector<LocalTerm> terms = p.local_terms();
    for (LocalTerm& t : terms) {
      const int width = t.kind == LocalKind::pose ? p.model().nq : p.model().ndof;
      t.weight = parcel.add(t.weight, n);
      t.dof_weight = parcel.add(t.dof_weight, p.model().ndof);
      t.target = parcel.add(t.target, n * width);
    }
    return parcel.add(terms.data(), terms.size());
  }

  // What of the problems is given, in device memory.
  std::vector<FramesSystem> pack(const std::vector<BatchMember>& members,
                                 const ExecutorOptions& options) {
    std::vector<FramesSystem> systems(count_);
    const auto fill = [&](Parcel& parcel) {
      for (int p = 0; p < count_; ++p) {
        const TrajectoryProblem& problem = *members[p].problem;
        FramesSystem& s = systems[p];
        s.frame_count = problem.frame_count();
        s.in = pack_input(parcel, problem, options.augmentation);
        s.local = pack_local(parcel, problem);
        s.nlocal = static_cast<int>(problem.local_terms().size());
        s.smoothing = options.smoothing;
        s.epsilon = options.epsilon;
      }
    };
    Parcel measured(nullptr);
    fill(measured);
    unsigned char* base = allocate<unsigned char>(measured.size());
    Parcel parcel(base);
    fill(parcel);
    device_.upload(base, parcel.data(), parcel.size());
    return systems;
  }

  // Frames -1 and 0 of every problem, and its start: of the current point and both trials.
  void place_frames(const std::vector<BatchMember>& members, std::vector<FramesSystem>& systems) {
    std::vector<double> values(frames_each_ * count_);
    for (int p = 0; p < count_; ++p) {
      double* at = values.data() + p * frames_each_;
      std::copy_n(members[p].problem->initial().data(), first_state_, at);
      std::copy(members[p].state->begin(), members[p].state->end(), at + first_state_);
    }
    for (int k = 0; k < 3; ++k) {
      const Rows frames(*this, frames_each_);
      device_.upload(frames.of(0), values.data(), values.size() * sizeof(double));
      if (k == 0) frames_ = frames.of(0);
      for (int p = 0; p < count_; ++p)
        (k == 0 ? systems[p].current : systems[p].trial[k - 1]).frames = frames.of(p);
    }
  }

  void place(const std::vector<BatchMember>& members, const ExecutorOptions& options,
             int most_lanes) {
    const TrajectoryProblem& one = *members[0].problem;
    const std::size_t n = one.frame_count(), d = one.primal(), m = one.dual();
    const std::size_t block = 2 * (d + m), blocks = (n + 1) / 2, rows = blocks * block;
    std::vector<FramesSystem> systems = pack(members, options);
    terms_ = systems[0].terms();
    first_state_ = 2L * one.model().nq;
    frames_each_ = (n + 2) * one.model().nq;
    place_frames(members, systems);

    Controls* device_controls = allocate<Controls>(count_);
    const Rows hessian(*this, n * 6 * d * d), gradient(*this, n * 3 * d);
    const Rows jacobian(*this, n * 3 * m * d), node_gradient(*this, n * d);
    const Rows cost(*this, n * systems[0].in.nterm), local_cost(*this, n * systems[0].nlocal);
    const Rows rhs(*this, 2 * rows), steps(*this, 2 * rows), correction(*this, rows);
    const Rows items(*this, kStepItems * n);
    const Rows step0(*this, n * d), step1(*this, n * d);
    const Rows at0(*this, n * m), at1(*this, n * m), at2(*this, n * m);
    const std::size_t actuated = one.model().actuated.size();
    const Rows torque(*this, n * actuated);
    for (std::size_t p = 0; p < systems.size(); ++p) {
      FramesSystem& s = systems[p];
      s.in.frames = s.current.frames;
      s.controls = device_controls + p;
      s.current.step = nullptr;  // nothing led there
      s.trial[0].step = step0.of(p);
      s.trial[1].step = step1.of(p);
      s.current.constraint = at0.of(p);
      s.trial[0].constraint = at1.of(p);
      s.trial[1].constraint = at2.of(p);
      s.hessian = hessian.of(p);
      s.gradient = gradient.of(p);
      s.jacobian = jacobian.of(p);
      s.torque = torque.of(p);
      s.cost = cost.of(p);
      s.local_cost = local_cost.of(p);
      s.node_gradient = node_gradient.of(p);
      s.diagonal = solver_.diagonal() + p * blocks * block * block;
      s.lower = solver_.lower() + p * (blocks - 1) * block * block;
      s.rhs = rhs.of(p);
      s.steps = steps.of(p);
      s.correction = correction.of(p);
      s.items = items.of(p);
    }
    steps_ = systems[0].steps;
    rhs_ = systems[0].rhs;
    correction_ = systems[0].correction;
    FramesSystem* device_systems = allocate<FramesSystem>(systems.size());
    device_.upload(device_systems, systems.data(), systems.size() * sizeof(FramesSystem));

    batch_.systems = device_systems;
    batch_.active = device_active_ = allocate<int>(count_ + 1);
    batch_.frames = static_cast<long>(n);
    batch_.lanes = std::min<long>(most_lanes, n * count_);
    batch_.scratch_bytes = scratch_bytes(members, options.augmentation);
    batch_.scratch = allocate<unsigned char>(batch_.lanes * batch_.scratch_bytes);
    const std::size_t most = std::max<std::size_t>(terms_ + 1, kStepItems);
    partial_ = allocate<double>(count_ * most * tree_chunks(batch_.frames));
    device_results_ = allocate<double>(count_ * most);
    device_controls_ = device_controls;
    results_ = device_.template pinned<double>(count_ * most);
    controls_ = device_.template pinned<Controls>(count_);
    active_ = device_.template pinned<int>(count_ + 1);
    failed_ = device_.template pinned<int>(count_);
    std::fill_n(controls_, count_, Controls{});
  }

  // Whole cache lines, so that neighbouring frames share none.
  static std::size_t scratch_bytes(const std::vector<BatchMember>& members, double augmentation) {
    std::size_t most = 0;
    for (const BatchMember& m : members) {
      const FrameInput in = m.problem->frame_input(nullptr, augmentation);
      most = std::max(most, frame_scratch_bytes<double>(in));
    }
    return (most + 127) / 128 * 128;
  }

  // Launches -----------------------------------------------------------------------------------

  using Bytes = decltype(std::declval<Device>().allocate(0));
  using Recording = typename Device::Recording;

  // The recording for a number of problems: for the next power of two, made when first needed.
  // Few problems that are left then do not pay for many that have ended.
  const Recording& recording(Request::Kind kind, std::size_t problems) {
    const std::size_t level = std::bit_width(problems - 1);
    if (recordings_.size() <= level) recordings_.resize(level + 1);
    Recordings& r = recordings_[level];
    const std::size_t at = static_cast<std::size_t>(kind);
    if (!r.made[at]) {
      FramesBatch batch = batch_;
      batch.places = std::min<long>(1L << level, count_);
      batch.lanes = std::min(batch_.lanes, batch.places * batch.frames);
      solver_.list(device_active_, static_cast<int>(batch.places));
      r.of[at] = device_.record([&] { enqueue(kind, batch); });
      r.made[at] = true;
    }
    return r.of[at];
  }

  void enqueue(Request::Kind kind, const FramesBatch& b) {
    device_.copy_in(device_active_, active_, (1 + b.places) * sizeof(int));
    device_.copy_in(device_controls_, controls_, count_ * sizeof(Controls));
    switch (kind) {
      case Request::Kind::move:
        device_(NodesWork<AcceptTrial>{b});
        [[fallthrough]];
      case Request::Kind::linearize:
        device_(FramesWork<true>{b, false});
        fold<PointItems>(b, false, terms_ + 1);
        device_(NodesWork<GatherGradient>{b});
        break;
      // One sequence of launches up to the steps' numbers: nothing of it is worth an answer before.
      case Request::Kind::steps:
        device_(AssembleWork{b});
        solver_.factor();
        device_.copy_out(failed_, solver_.failed(), count_ * sizeof(int));
        device_(NodesWork<RemoveEpsilon>{b});
        device_(NodesWork<WriteStepsRhs>{b});
        solver_.solve(steps_, 2);
        solver_.refine(rhs_, steps_, 2, KktSystem::kRefinements, KktSystem::kRefineTolerance);
        device_(NodesWork<MeasureSteps>{b});
        fold<StepItems>(b, false, kStepItems);
        break;
      case Request::Kind::trial:
        device_(NodesWork<ComposeStep>{b});
        evaluate_trial(b);
        break;
      case Request::Kind::correction:
        device_(NodesWork<WriteCorrectionRhs>{b});
        solver_.solve(correction_, 1);
        device_(NodesWork<ApplyCorrection>{b});
        evaluate_trial(b);
        break;
      case Request::Kind::nothing:
        break;
    }
  }

  void evaluate_trial(const FramesBatch& b) {
    device_(FramesWork<false>{b, true});
    fold<PointItems>(b, true, terms_ + 1);
  }

  template <class Items>
  void fold(const FramesBatch& b, bool tried, int folds) {
    device_(FoldChunksWork<Items>{b, tried, folds, partial_});
    device_(FoldRestWork{b, folds, partial_, device_results_});
    device_.copy_out(results_, device_results_, b.places * folds * sizeof(double));
  }

  struct Recordings {
    Recording of[Request::kKinds];
    bool made[Request::kKinds] = {};
  };

  Device device_;
  const int count_;
  typename Device::Solver solver_;
  std::vector<Point> points_;
  std::vector<Bytes> buffers_;
  FramesBatch batch_{};
  int terms_ = 0;
  std::size_t first_state_ = 0, frames_each_ = 0;
  double* frames_ = nullptr;  // of the current points
  double *rhs_ = nullptr, *steps_ = nullptr, *correction_ = nullptr;
  double *partial_ = nullptr, *device_results_ = nullptr;
  Controls* device_controls_ = nullptr;
  int* device_active_ = nullptr;
  double* results_ = nullptr;  // pinned, as all below
  Controls* controls_ = nullptr;
  int *active_ = nullptr, *failed_ = nullptr;
  std::vector<Recordings> recordings_;  // by the binary logarithm of the places
  Stopwatch watch_;
};

}  // namespace trajopt
