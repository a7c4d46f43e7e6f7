#include "trajopt/problem/trajectory_problem.h"

#include <algorithm>
#include <cmath>

#include "trajopt/base/error.h"
#include "trajopt/base/parallel.h"
#include "trajopt/model/configuration.h"
#include "trajopt/problem/callback_rows.h"
#include "trajopt/problem/node_kernels.h"
#include "trajopt/problem/node_rows.h"
#include "trajopt/problem/ring.h"
#include "trajopt/problem/spline_kernels.h"

namespace trajopt {

namespace {

void check_size(const std::string& name, std::size_t size, std::size_t expected) {
  if (size == expected) return;
  throw ArgumentError(name + " holds " + std::to_string(size) + " numbers, expected " +
                      std::to_string(expected));
}

}  // namespace

// The kernels read all of these without looking.
void TrajectoryProblem::check_sizes() const {
  if (frame_count_ < 1) {
    throw ArgumentError("dt holds " + std::to_string(dt_.size()) +
                        " steps, expected at least 2: one before the first frame");
  }
  const std::size_t n = frame_count_, d = model_.ndof, nq = model_.nq;
  check_size("initial", initial_.size(), 2 * nq);
  check_size("velocity", velocity_.size(), d);
  const auto check_term = [&](const auto& term, std::size_t target, bool needed) {
    check_size("weight of term '" + term.name + "'", term.weight.size(), n);
    if (needed || !term.target.empty())
      check_size("target of term '" + term.name + "'", term.target.size(), target);
  };
  for (const DenseObjective& term : objective_.dense) {
    check_term(term, 3 * n, false);
    const int joints = static_cast<int>(model_.joints.size());
    if (term.term.joint < 0 || term.term.joint >= joints) {
      throw ArgumentError("joint of term '" + term.name + "' is " +
                          std::to_string(term.term.joint) + ", the model has " +
                          std::to_string(joints));
    }
  }
  for (const LocalObjective& term : objective_.local) {
    const bool pose = term.kind == LocalKind::pose;
    check_term(term, n * (pose ? nq : d), pose);
    check_size("dof_weight of term '" + term.name + "'", term.dof_weight.size(), d);
  }
  for (const CallbackObjective& term : objective_.callbacks) {
    if (term.rows >= 0 && term.frames == frame_count_) continue;
    throw ArgumentError("term '" + term.name + "' has " + std::to_string(term.rows) +
                        " rows of each of " + std::to_string(term.frames) + " frames, expected " +
                        std::to_string(n) + " frames");
  }
}

TrajectoryProblem::TrajectoryProblem(Model model, const Physics& physics, std::vector<double> dt,
                                     Objective objective, std::vector<double> initial,
                                     std::vector<double> velocity, const ProblemOptions& options)
    : model_(std::move(model)),
      physics_(physics),
      dt_(std::move(dt)),
      objective_(std::move(objective)),
      initial_(std::move(initial)),
      velocity_(std::move(velocity)),
      options_(options),
      frame_count_(static_cast<int>(dt_.size()) - 1) {
  check_sizes();
  const int d = model_.ndof, m = static_cast<int>(model_.unactuated.size());
  if (options_.formulation == Formulation::spline) {
    if (options_.frames_per_knot < 2) {  // a velocity would move no frame
      throw ArgumentError("frames_per_knot = " + std::to_string(options_.frames_per_knot) +
                          ": expected at least 2");
    }
    if (frame_count_ % options_.frames_per_knot != 0) {
      throw ArgumentError(
          "frames = " + std::to_string(frame_count_) +
          ": expected a multiple of frames_per_knot = " + std::to_string(options_.frames_per_knot));
    }
    nodes_ = frame_count_ / options_.frames_per_knot;
    primal_ = 2 * d;
    dual_ = 2 * m;
    spline_ = std::make_unique<HermiteSpline>(model_, nodes_, options_.frames_per_knot);
  } else {
    nodes_ = frame_count_;
    primal_ = d;
    dual_ = m;
  }
  if (options_.periodic &&
      (options_.formulation == Formulation::spline || frame_count_ % 2 != 0 || frame_count_ < 8)) {
    throw ArgumentError(
        "periodic = true: expected formulation frames and an even number of at "
        "least 8 frames, got " +
        std::to_string(frame_count_));
  }
  for (int i = 1; i <= frame_count_; ++i)
    stencils_.push_back(make_stencil(physics_, dt_[i], dt_[i - 1]));
  for (const DenseObjective& term : objective_.dense) {
    std::vector<double>& scale = scales_.emplace_back(term.weight);
    for (double& w : scale) w = std::sqrt(2 * w);
  }
  for (std::size_t k = 0; k < objective_.dense.size(); ++k) {
    DenseTerm term = objective_.dense[k].term;
    term.scale = scales_[k].data();
    term.target = objective_.dense[k].target.empty() ? nullptr : objective_.dense[k].target.data();
    terms_.push_back(term);
  }
  for (const LocalObjective& term : objective_.local) {
    local_terms_.push_back({term.kind, term.weight.data(), term.dof_weight.data(),
                            term.target.empty() ? nullptr : term.target.data()});
  }
  const std::size_t n = frame_count_;
  cost_.resize(n * terms_.size());
  local_cost_.resize(n * local_terms_.size());
  items_.resize(n);
}

std::size_t TrajectoryProblem::state_size() const {
  return static_cast<std::size_t>(nodes_) * (model_.nq + (spline_ ? model_.ndof : 0));
}

void TrajectoryProblem::check_state(const State& state) const {
  check_size("state", state.size(), state_size());
}

State TrajectoryProblem::state_from_frames(const double* frames) const {
  const int nq = model_.nq, d = model_.ndof;
  if (!spline_) return State(frames, frames + static_cast<std::size_t>(frame_count_) * nq);
  std::vector<double> all(initial_.begin() + nq, initial_.end());
  all.insert(all.end(), frames, frames + static_cast<std::size_t>(frame_count_) * nq);
  std::vector<double> q((nodes_ + 1) * nq), v((nodes_ + 1) * d);
  spline_->fit(all.data(), q.data(), v.data());
  State state(q.begin() + nq, q.end());
  state.insert(state.end(), v.begin() + d, v.end());
  return state;
}

ControlPoints TrajectoryProblem::control_points(const State& state) const {
  const int nq = model_.nq;
  return {initial_.data() + nq, velocity_.data(), state.data(),
          state.data() + static_cast<std::size_t>(nodes_) * nq};
}

void TrajectoryProblem::frames_of(const State& state, std::vector<double>& frames) const {
  check_state(state);
  const int nq = model_.nq;
  frames.resize(static_cast<std::size_t>(frame_count_ + 2) * nq);
  std::copy(initial_.begin(), initial_.end(), frames.begin());
  if (spline_) {
    spline_->frames(control_points(state), frames.data() + 2 * nq, options_.threads);
    return;
  }
  std::copy(state.begin(), state.end(), frames.begin() + 2 * nq);
  if (options_.periodic) {
    for (int k = 0; k < 2; ++k) {
      const double* from = state.data() + static_cast<std::size_t>(frame_count_ - 2 + k) * nq;
      one_period_before(view(model_), options_.stride, from, frames.data() + k * nq);
    }
  }
}

void TrajectoryProblem::retract(const State& state, const double* step, State& out) const {
  check_state(state);
  out.resize(state.size());
  const ModelView model = view(model_);
  if (spline_) {
    const SplineView spline = spline_->view();
    parallel_for(nodes_, options_.threads, [&](long z, int) {
      spline_kernels().retract(model, spline, state.data(), step, z, out.data());
    });
    return;
  }
  const NodeKernels& kernels = node_kernels();
  parallel_for(tree_chunks(nodes_), options_.threads, [&](long chunk, int) {
    const long begin = chunk * kTreeWidth, end = std::min<long>(begin + kTreeWidth, nodes_);
    kernels.retract(model, begin, end, state.data(), step, primal_, out.data());
  });
}

void TrajectoryProblem::evaluate(const State& state, Evaluation& out) {
  run(state, 0, out, nullptr);
}

void TrajectoryProblem::linearize(const State& state, double augmentation, Evaluation& out,
                                  Linearization& lin) {
  run(state, augmentation, out, &lin);
  if (spline_) spline_->linearize(control_points(state), options_.threads);
  reduce_gradient(lin);
}

FrameInput TrajectoryProblem::frame_input(const double* frames, double augmentation) const {
  return {view(model_),
          &physics_,
          stencils_.data(),
          dt_.data(),
          frames,
          terms_.data(),
          static_cast<int>(terms_.size()),
          augmentation};
}

void TrajectoryProblem::run(const State& state, double augmentation, Evaluation& out,
                            Linearization* lin) {
  const long n = frame_count_, d = model_.ndof;
  const long m = model_.unactuated.size(), nu = model_.actuated.size();
  frames_of(state, out.frames);
  out.frame_constraint.resize(n * m);
  out.torque.resize(n * nu);
  const FrameInput in = frame_input(out.frames.data(), augmentation);
  const std::size_t bytes = frame_kernels().scratch_bytes(in);
  const int workers = std::max(options_.threads, 1);
  if (bytes > scratch_bytes_ || static_cast<int>(scratch_.size()) < workers) {
    scratch_.clear();
    for (int k = 0; k < workers; ++k) scratch_.push_back(aligned_buffer(bytes));
    scratch_bytes_ = bytes;
  }
  evaluate_callbacks(out, lin != nullptr);
  if (lin != nullptr) lin->gradient.resize(n * 3 * d);
  if (lin != nullptr && lin->by_nodes) {
    run_nodes(in, out, *lin);
  } else {
    run_frames(in, out, lin);
  }

  out.terms.assign(objective_.size(), 0.0);
  std::size_t index = 0;
  for (std::size_t k = 0; k < terms_.size(); ++k) {
    for (long f = 0; f < n; ++f) items_[f] = cost_[f * terms_.size() + k];
    out.terms[index++] = folded<Sum>(items_.data(), n);
  }
  for (std::size_t k = 0; k < local_terms_.size(); ++k)
    out.terms[index++] = folded<Sum>(local_cost_.data() + k * n, n);
  for (CallbackValues& values : callbacks_) out.terms[index++] = folded<Sum>(values.cost.data(), n);
  out.objective = 0;
  for (double t : out.terms) out.objective += t;

  reduce_constraint(out.frame_constraint, out.constraint);
  const auto largest = [](const std::vector<double>& v) {
    double r = 0;
    for (double x : v) r = Largest{}(r, magnitude(x));
    return r;
  };
  out.frame_violation = largest(out.frame_constraint);
  out.constraint_norm = spline_ ? largest(out.constraint) : out.frame_violation;
}

// Functions of the user, of all frames at once.
void TrajectoryProblem::evaluate_callbacks(const Evaluation& out, bool derivatives) {
  const long n = frame_count_, d = model_.ndof;
  callbacks_.resize(objective_.callbacks.size());
  for (std::size_t k = 0; k < callbacks_.size(); ++k) {
    const CallbackObjective& term = objective_.callbacks[k];
    CallbackValues& values = callbacks_[k];
    values.cost.resize(n);
    values.residual.resize(n * term.rows);
    if (derivatives) values.jacobian.resize(n * term.rows * 3 * d);
    term.evaluate(out.frames.data(), values.residual.data(),
                  derivatives ? values.jacobian.data() : nullptr);
  }
}

// Their cost of a frame and, with derivatives, their share of its window.
void TrajectoryProblem::add_callbacks(const FrameOutput& out, bool derivatives, long f) {
  const long d = model_.ndof;
  for (std::size_t k = 0; k < callbacks_.size(); ++k) {
    const CallbackObjective& term = objective_.callbacks[k];
    CallbackValues& values = callbacks_[k];
    const CallbackRows rows{term.rows, term.weight, values.residual.data() + f * term.rows,
                            derivatives ? values.jacobian.data() + f * term.rows * 3 * d : nullptr};
    values.cost[f] = callback_cost(rows);
    if (derivatives)
      add_callback_rows(Serial{}, rows, static_cast<int>(d), out.hessian + f * 6 * d * d,
                        out.gradient + f * 3 * d);
  }
}

// Frames [begin, end) with all of their terms, while the windows are in cache.
void TrajectoryProblem::run_chunk(const FrameInput& in, const FrameOutput& out, bool derivatives,
                                  long begin, long end, int worker) {
  const FrameKernels& kernels = frame_kernels();
  const auto kernel = derivatives ? kernels.linearize : kernels.evaluate;
  const auto local_kernel = node_kernels().local_term;
  for (long f = begin; f < end; f += kernels.lanes) {
    const long last = std::min<long>(f + kernels.lanes, end);
    kernel(in, f, static_cast<int>(last - f), scratch_[worker].get(), out);
    for (std::size_t k = 0; k < local_terms_.size(); ++k) {
      local_kernel(in, local_terms_[k], f, last, out.hessian, out.gradient,
                   local_cost_.data() + k * frame_count_);
    }
    for (long i = f; i < last; ++i) add_callbacks(out, derivatives, i);
  }
}

void TrajectoryProblem::run_frames(const FrameInput& in, Evaluation& out, Linearization* lin) {
  const long n = frame_count_, d = model_.ndof, m = model_.unactuated.size();
  if (lin != nullptr) {
    lin->hessian.resize(n * 6 * d * d);
    lin->jacobian.resize(n * 3 * m * d);
  }
  const FrameOutput to{out.frame_constraint.data(),
                       out.torque.data(),
                       cost_.data(),
                       lin ? lin->hessian.data() : nullptr,
                       lin ? lin->gradient.data() : nullptr,
                       lin ? lin->jacobian.data() : nullptr};
  const int lanes = frame_kernels().lanes;
  parallel_for((n + lanes - 1) / lanes, std::max(options_.threads, 1), [&](long group, int worker) {
    run_chunk(in, to, lin != nullptr, group * lanes, std::min((group + 1) * lanes, n), worker);
  });
}

// Windows live in the cache only: a worker adds those of a chunk of frames to the nodes' rows
// before it goes on. What a chunk has for the two nodes before it is added when all chunks are
// done.
void TrajectoryProblem::run_nodes(const FrameInput& in, Evaluation& out, Linearization& lin) {
  constexpr long kFrames = 16;  // of a chunk: a multiple of any kernel's lanes
  constexpr long kSpare = 64;   // kernels load whole vectors at the last element
  const long n = frame_count_, d = model_.ndof, m = model_.unactuated.size();
  const long chunks = (n + kFrames - 1) / kFrames, spill = NodeRows::kSpillBlocks * d * d;
  const long window = 6 * d * d, jacobian = 3 * m * d;
  const int workers = std::max(options_.threads, 1);
  const NodeRows rows{nodes_, primal_, dual_, 0.0, 0.0, nullptr};
  lin.node_rows.resize(n * rows.length() + kSpare);
  spill_.resize(chunks * spill);
  windows_.resize(workers);
  for (LargeVector<double>& w : windows_) w.resize(kFrames * (window + jacobian));
  const NodeRowKernels& kernels = node_row_kernels(Isa::avx512);
  parallel_for(chunks, workers, [&](long chunk, int worker) {
    const long begin = chunk * kFrames, end = std::min(begin + kFrames, n);
    double* windows = windows_[worker].data();
    double* jacobians = windows + kFrames * window;
    // As if the arrays began with frame 0, as the kernels have it.
    const FrameOutput to{
        out.frame_constraint.data(), out.torque.data(),   cost_.data(),
        windows - begin * window,    lin.gradient.data(), jacobians - begin * jacobian};
    run_chunk(in, to, true, begin, end, worker);
    kernels.add_windows(rows, begin, end, windows, jacobians, lin.node_rows.data(),
                        spill_.data() + chunk * spill);
  });
  parallel_for(chunks - 1, workers, [&](long chunk, int) {
    kernels.add_spill(rows, (chunk + 1) * kFrames, spill_.data() + (chunk + 1) * spill,
                      lin.node_rows.data());
  });
}

void TrajectoryProblem::reduce_constraint(const std::vector<double>& frame_constraint,
                                          std::vector<double>& constraint) const {
  if (!spline_) {
    constraint = frame_constraint;
    return;
  }
  const SplineKernels& kernels = spline_kernels();
  const SplineView spline = spline_->view();
  constraint.resize(static_cast<std::size_t>(nodes_) * dual_);
  parallel_for(nodes_, options_.threads, [&](long z, int) {
    kernels.reduce_constraint(spline, dual_ / 2, frame_constraint.data(), z, constraint.data());
  });
}

void TrajectoryProblem::reduce_gradient(Linearization& lin) const {
  const int n = frame_count_, d = model_.ndof;
  const NodeKernels& kernels = node_kernels();
  std::vector<double>& by_frame = spline_ ? lin.frame_gradient : lin.node_gradient;
  by_frame.resize(static_cast<std::size_t>(n) * d);
  parallel_for(tree_chunks(n), options_.threads, [&](long chunk, int) {
    const long begin = chunk * kTreeWidth, end = std::min<long>(begin + kTreeWidth, n);
    kernels.gather_gradient(lin.gradient.data(), n, d, options_.periodic, begin, end,
                            by_frame.data());
  });
  if (!spline_) return;
  const SplineView spline = spline_->view();
  lin.node_gradient.resize(static_cast<std::size_t>(nodes_) * primal_);
  parallel_for(nodes_, options_.threads, [&](long z, int) {
    spline_kernels().reduce_gradient(spline, d, by_frame.data(), z, lin.node_gradient.data());
  });
}

}  // namespace trajopt
