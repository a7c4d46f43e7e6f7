#include "trajopt/problem/trajectory_problem.h"

#include <algorithm>
#include <cmath>

#include "trajopt/base/error.h"
#include "trajopt/base/parallel.h"
#include "trajopt/model/configuration.h"
#include "trajopt/problem/callback_rows.h"
#include "trajopt/problem/node_kernels.h"
#include "trajopt/problem/ring.h"

namespace trajopt {

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

void TrajectoryProblem::frames_of(const State& state, std::vector<double>& frames) const {
  const int nq = model_.nq;
  frames.resize(static_cast<std::size_t>(frame_count_ + 2) * nq);
  std::copy(initial_.begin(), initial_.end(), frames.begin());
  if (spline_) {
    std::vector<double> q(initial_.begin() + nq, initial_.end()), v(velocity_);
    q.insert(q.end(), state.begin(), state.begin() + nodes_ * nq);
    v.insert(v.end(), state.begin() + nodes_ * nq, state.end());
    spline_->frames(q.data(), v.data(), frames.data() + nq);
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
  const int nq = model_.nq, d = model_.ndof;
  out.resize(state.size());
  const ModelView model = view(model_);
  const NodeKernels& kernels = node_kernels();
  parallel_for(tree_chunks(nodes_), options_.threads, [&](long chunk, int) {
    const long begin = chunk * kTreeWidth, end = std::min<long>(begin + kTreeWidth, nodes_);
    kernels.retract(model, begin, end, state.data(), step, primal_, out.data());
  });
  if (spline_) {
    const std::size_t base = static_cast<std::size_t>(nodes_) * nq;
    for (int i = 0; i < nodes_; ++i)
      for (int k = 0; k < d; ++k)
        out[base + i * d + k] = state[base + i * d + k] + step[i * primal_ + d + k];
  }
}

void TrajectoryProblem::evaluate(const State& state, Evaluation& out) {
  run(state, 0, out, nullptr);
}

void TrajectoryProblem::linearize(const State& state, double augmentation, Evaluation& out,
                                  Linearization& lin) {
  run(state, augmentation, out, &lin);
  if (spline_) {
    const int nq = model_.nq;
    std::vector<double> q(initial_.begin() + nq, initial_.end()), v(velocity_);
    q.insert(q.end(), state.begin(), state.begin() + nodes_ * nq);
    v.insert(v.end(), state.begin() + nodes_ * nq, state.end());
    spline_->linearize(q.data(), v.data());
  }
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
  if (lin != nullptr) {
    lin->hessian.resize(n * 6 * d * d);
    lin->gradient.resize(n * 3 * d);
    lin->jacobian.resize(n * 3 * m * d);
  }
  const FrameInput in = frame_input(out.frames.data(), augmentation);
  const FrameOutput frame_out{out.frame_constraint.data(),
                              out.torque.data(),
                              cost_.data(),
                              lin ? lin->hessian.data() : nullptr,
                              lin ? lin->gradient.data() : nullptr,
                              lin ? lin->jacobian.data() : nullptr};
  const FrameKernels& kernels = frame_kernels();
  const std::size_t bytes = kernels.scratch_bytes(in);
  const int workers = std::max(options_.threads, 1);
  if (bytes > scratch_bytes_ || static_cast<int>(scratch_.size()) < workers) {
    scratch_.clear();
    for (int k = 0; k < workers; ++k) scratch_.push_back(aligned_buffer(bytes));
    scratch_bytes_ = bytes;
  }
  const auto kernel = lin ? kernels.linearize : kernels.evaluate;
  const auto local_kernel = node_kernels().local_term;
  parallel_for((n + kernels.lanes - 1) / kernels.lanes, workers, [&](long group, int worker) {
    const long begin = group * kernels.lanes;
    const long end = std::min<long>(begin + kernels.lanes, n);
    kernel(in, begin, static_cast<int>(end - begin), scratch_[worker].get(), frame_out);
    for (std::size_t k = 0; k < local_terms_.size(); ++k) {  // while the windows are in cache
      local_kernel(in, local_terms_[k], begin, end, frame_out.hessian, frame_out.gradient,
                   local_cost_.data() + k * n);
    }
  });

  out.terms.assign(objective_.size(), 0.0);
  std::size_t index = 0;
  for (std::size_t k = 0; k < terms_.size(); ++k) {
    for (long f = 0; f < n; ++f) items_[f] = cost_[f * terms_.size() + k];
    out.terms[index++] = folded<Sum>(items_.data(), n);
  }
  for (std::size_t k = 0; k < local_terms_.size(); ++k)
    out.terms[index++] = folded<Sum>(local_cost_.data() + k * n, n);
  for (const CallbackObjective& term : objective_.callbacks) {
    add_callback(term, out, lin);
    out.terms[index++] = folded<Sum>(items_.data(), n);
  }
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

// Leaves the cost of every frame in items_.
void TrajectoryProblem::add_callback(const CallbackObjective& term, const Evaluation& out,
                                     Linearization* lin) {
  const long n = frame_count_, d = model_.ndof, rows = term.rows;
  callback_residual_.resize(n * rows);
  if (lin) callback_jacobian_.resize(n * rows * 3 * d);
  term.evaluate(out.frames.data(), callback_residual_.data(),
                lin ? callback_jacobian_.data() : nullptr);
  parallel_for(n, options_.threads, [&](long f, int) {
    const CallbackRows t{term.rows, term.weight, callback_residual_.data() + f * rows,
                         lin ? callback_jacobian_.data() + f * rows * 3 * d : nullptr};
    items_[f] = callback_cost(t);
    if (!lin) return;
    add_callback_rows(Serial{}, t, static_cast<int>(d), lin->hessian.data() + f * 6 * d * d,
                      lin->gradient.data() + f * 3 * d);
  });
}

void TrajectoryProblem::reduce_constraint(const std::vector<double>& frame_constraint,
                                          std::vector<double>& constraint) const {
  if (!spline_) {
    constraint = frame_constraint;
    return;
  }
  const int m = dual_ / 2;
  constraint.assign(static_cast<std::size_t>(nodes_) * dual_, 0.0);
  for (int i = 1; i <= frame_count_; ++i) {
    for (const SplineWeight& w : spline_->weights(i).weights) {
      if (w.node < 0) continue;
      for (int r = 0; r < m; ++r)
        constraint[w.node * dual_ + w.half * m + r] += w.value * frame_constraint[(i - 1) * m + r];
    }
  }
}

void TrajectoryProblem::reduce_gradient(Linearization& lin) const {
  const int n = frame_count_, d = model_.ndof;
  const NodeKernels& kernels = node_kernels();
  const auto gather = [&](double* out) {  // by frame
    parallel_for(tree_chunks(n), options_.threads, [&](long chunk, int) {
      const long begin = chunk * kTreeWidth, end = std::min<long>(begin + kTreeWidth, n);
      kernels.gather_gradient(lin.gradient.data(), n, d, options_.periodic, begin, end, out);
    });
  };
  if (!spline_) {
    lin.node_gradient.resize(static_cast<std::size_t>(n) * d);
    return gather(lin.node_gradient.data());
  }
  std::vector<double> by_frame(static_cast<std::size_t>(n) * d);
  gather(by_frame.data());
  lin.node_gradient.assign(static_cast<std::size_t>(nodes_) * primal_, 0.0);
  for (int i = 1; i <= n; ++i) {
    const double* g = by_frame.data() + static_cast<std::size_t>(i - 1) * d;
    for (const SplineWeight& w : spline_->weights(i).weights) {
      if (w.node < 0) continue;
      double* out = lin.node_gradient.data() + w.node * primal_ + w.half * d;
      int ball = 0;
      for (const Joint& joint : model_.joints) {
        if (joint.type != JointType::ball) {
          out[joint.dof] += w.value * g[joint.dof];
          continue;
        }
        const double* r = w.rotation + 9 * ball++;
        for (int a = 0; a < 3; ++a)
          for (int b = 0; b < 3; ++b) out[joint.dof + a] += r[3 * b + a] * g[joint.dof + b];
      }
    }
  }
}

}  // namespace trajopt
