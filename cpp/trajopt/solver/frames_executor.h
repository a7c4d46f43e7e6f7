// The executor of both formulations on a device: memory of its own, work in launches, many
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
//   Solver(device, blocks, size, ordering, signs, batch, ring)   of the KKT matrices at arrays(),
//     which begin as zeros; of a ring the last of the blocks is the border. After
//     list(listed, places) factor(), solve(x, m), reserve(m) and refine(rhs, x, m, steps,
//     tolerance) are launches for listed[0] problems, those in listed[1] on. failed(), in device
//     memory, holds kNever or anything else by problem; failure(problem) then says why.
//     ordering() is the one taken, never automatic
//
// The CUDA device is in cuda/trajopt/cuda/solver; tests have one that runs every launch on the
// processor. Both give the bits of the processor's executor for the same elimination order.
#pragma once

#include <algorithm>
#include <utility>

#include "trajopt/linalg/group_system.h"
#include "trajopt/solver/executor.h"
#include "trajopt/solver/frames_launches.h"
#include "trajopt/solver/frames_memory.h"
#include "trajopt/solver/stopwatch.h"

namespace trajopt {

template <class Device>
class FramesExecutor final : public BatchExecutor {
 public:
  static constexpr int kMostLanes = 1 << 14;  // frames in work at once: some waves of an H200

  // The members must have the same shape; at least one.
  FramesExecutor(Device device, const std::vector<BatchMember>& members,
                 const ExecutorOptions& options, int most_lanes = kMostLanes)
      : device_(std::move(device)),
        count_(static_cast<int>(members.size())),
        solver_(device_, (members[0].problem->nodes() + 1) / 2,
                2 * (members[0].problem->primal() + members[0].problem->dual()), options.ordering,
                make_signs(*members[0].problem), count_, members[0].problem->options().periodic),
        memory_(device_, members, options, most_lanes, solver_.arrays()),
        host_terms_(device_, members),
        launches_(device_, solver_, memory_, host_terms_) {
    points_.reserve(count_);
    for (const BatchMember& m : members) points_.emplace_back(*this, *m.state);
    solver_.reserve(2);
  }

  int size() const override { return count_; }
  SqpPoint& point(int problem) override { return points_[problem]; }

  void answer(Request::Kind kind, const std::vector<int>& problems,
              const std::vector<Request>& requests, std::vector<Answer>& answers) override {
    if (problems.empty() || kind == Request::Kind::nothing) return;
    watch_.lap();
    memory_.active[0] = static_cast<int>(problems.size());
    std::copy(problems.begin(), problems.end(), memory_.active + 1);
    for (int p : problems) {
      control(p, kind, requests[p]);
      answers[p] = {};
    }
    launches_.play(kind, problems, answers);
    const bool steps = kind == Request::Kind::steps;
    const int values = (steps ? memory_.step_folds() : memory_.point_folds()).folds;
    for (std::size_t place = 0; place < problems.size(); ++place) {
      Answer& answer = answers[problems[place]];
      if (!answer.error) read(problems[place], kind, memory_.results + place * values, answer);
    }
    // What was computed together is shared out evenly.
    const double each = watch_.lap() / static_cast<double>(problems.size());
    for (int p : problems) {
      PhaseSeconds& seconds = points_[p].seconds;
      (steps ? seconds.factorization : seconds.dynamics) += each;
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
    linalg::Ordering ordering() const override { return owner.solver_.ordering(); }
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

  static std::vector<signed char> make_signs(const TrajectoryProblem& problem) {
    const int width = problem.primal() + problem.dual(), nodes = problem.nodes();
    std::vector<signed char> signs(static_cast<std::size_t>(nodes + nodes % 2) * width, 1);
    for (int i = 0; i < nodes; ++i)
      std::fill_n(signs.begin() + static_cast<long>(i) * width, problem.dual(), -1);
    return signs;
  }

  // What the launches are to know of a request.
  void control(int p, Request::Kind kind, const Request& r) {
    Controls& c = memory_.controls[p];
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
    if (kind == Request::Kind::steps) {
      std::copy_n(values, kStepItems, a.steps.item);
      // The spline's C is not what the augmentation adds the squares of.
      if (memory_.splined()) a.steps.item[kConstraint2] = 0;
      a.factored = memory_.failed[p] == linalg::GroupSystem::kNever;
      if (!a.factored) point.text = solver_.failure(p);
      return;
    }
    const int terms = memory_.terms();
    for (int k = 0; k < terms; ++k) a.point.objective += values[k];
    a.point.frame_violation = values[terms];
    a.point.constraint_norm = values[memory_.splined() ? terms + 1 : terms];
    if (kind == Request::Kind::linearize || kind == Request::Kind::move)
      point.values.assign(values, values + terms);
  }

  void read_state(Point& point) {
    const int p = static_cast<int>(&point - points_.data());
    device_.download(point.host.data(), memory_.state(p), point.host.size() * sizeof(double));
  }

  Device device_;
  const int count_;
  typename Device::Solver solver_;
  FramesMemory<Device> memory_;
  HostTerms<Device> host_terms_;
  FramesLaunches<Device> launches_;
  std::vector<Point> points_;
  Stopwatch watch_;
};

}  // namespace trajopt
