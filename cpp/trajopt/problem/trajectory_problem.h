// A trajectory optimization problem: model, forces, grid, objective and the stencil its unknowns
// hang on. Evaluates objective and physics, and linearizes both.
//
// Formulation::frames (the default): every frame is an unknown and obeys physics by itself.
// Formulation::spline (Pan): control points of a Hermite spline; physics holds when tested with the
// spline's own basis (constraint reduction), C = (S^T (x) U_perp) [FD_1 ... FD_N].
//
// Unknowns are grouped in nodes (a frame, or a control point), each with `dual` multipliers and
// `primal` tangent coordinates, in this order: an elimination from the last row to the first then
// meets the definite primal block before the multipliers it supports.
#pragma once

#include <memory>
#include <vector>

#include "trajopt/base/buffer.h"
#include "trajopt/base/large_vector.h"
#include "trajopt/force/physics.h"
#include "trajopt/model/model.h"
#include "trajopt/problem/local_terms.h"
#include "trajopt/problem/objective.h"
#include "trajopt/trajectory/hermite.h"

namespace trajopt {

enum class Formulation { frames, spline };

struct ProblemOptions {
  Formulation formulation = Formulation::frames;
  int frames_per_knot = 10;
  bool periodic = false;         // frames only: x_{i+N} = x_i moved by `stride`
  double stride[3] = {0, 0, 0};  // added to the first three slides of every root
  int threads = 1;
};

// A point of the search space. frames: N x nq. spline: Z x nq configurations, then Z x D scaled
// velocities of the control points 1..Z.
using State = std::vector<double>;

struct Evaluation {
  double objective = 0;
  std::vector<double> terms;             // by Objective::names()
  std::vector<double> frames;            // (N + 2) x nq: x_{-1} .. x_N
  std::vector<double> frame_constraint;  // N x m: unactuated rows of FD
  std::vector<double> constraint;        // nodes x dual: reduced constraints C
  std::vector<double> torque;            // N x nu
  double constraint_norm = 0;            // |C|_inf
  double frame_violation = 0;            // max over frames and unactuated rows
};

// Per-frame derivative data (see FrameOutput), and the gradient by node.
struct Linearization {
  LargeVector<double> hessian, gradient, jacobian;  // N x 6 x D x D, N x 3 x D, N x 3 x m x D
  std::vector<double> frame_gradient;               // N x D, of the spline's frames
  std::vector<double> node_gradient;                // nodes x primal
  // Asked for (KktSystem::frontal_possible()), the matrix by nodes instead of windows and
  // Jacobians.
  bool by_nodes = false;
  LargeVector<double> node_rows;  // node_rows.h
};

class TrajectoryProblem {
 public:
  // dt: N + 1 steps, dt[i] = t_i - t_{i-1}, i = 0..N. initial: x_{-1}, x_0 as 2 x nq.
  // velocity: D, scaled to a segment (spline only: half of the fixed control point 0).
  // Throws ArgumentError where sizes do not fit.
  TrajectoryProblem(Model model, const Physics& physics, std::vector<double> dt,
                    Objective objective, std::vector<double> initial, std::vector<double> velocity,
                    const ProblemOptions& options);
  TrajectoryProblem(const TrajectoryProblem&) = delete;  // the spline refers to the model

  const Model& model() const { return model_; }
  const Physics& physics() const { return physics_; }
  const Objective& objective() const { return objective_; }
  const ProblemOptions& options() const { return options_; }
  const HermiteSpline& spline() const { return *spline_; }
  int frame_count() const { return frame_count_; }
  int nodes() const { return nodes_; }
  int primal() const { return primal_; }
  int dual() const { return dual_; }
  double dt(int frame) const { return dt_[frame]; }
  const std::vector<double>& dt() const { return dt_; }
  const std::vector<Stencil>& stencils() const { return stencils_; }
  const std::vector<double>& initial() const { return initial_; }
  const std::vector<DenseTerm>& dense_terms() const { return terms_; }
  const std::vector<LocalTerm>& local_terms() const { return local_terms_; }
  // Of the fixed control point, scaled to a segment.
  const std::vector<double>& velocity() const { return velocity_; }
  FrameInput frame_input(const double* frames, double augmentation) const;

  // All that take a State throw ArgumentError where it has another size than this.
  std::size_t state_size() const;
  State state_from_frames(const double* frames) const;                     // N x nq: x_1 .. x_N
  void frames_of(const State& state, std::vector<double>& frames) const;   // (N + 2) x nq
  void retract(const State& state, const double* step, State& out) const;  // step: nodes x primal

  void evaluate(const State& state, Evaluation& out);
  // Fills `out` for the same state as well. augmentation: adds that times A^T A per frame.
  void linearize(const State& state, double augmentation, Evaluation& out, Linearization& lin);

  // C = S^T C_frames.
  void reduce_constraint(const std::vector<double>& frame_constraint,
                         std::vector<double>& constraint) const;

 private:
  struct CallbackValues {                          // of a term
    std::vector<double> cost, residual, jacobian;  // N, N x rows, N x rows x 3 x D
  };

  void check_sizes() const;
  void check_state(const State& state) const;
  ControlPoints control_points(const State& state) const;
  void run(const State& state, double augmentation, Evaluation& out, Linearization* lin);
  void run_frames(const FrameInput& in, Evaluation& out, Linearization* lin);
  void run_nodes(const FrameInput& in, Evaluation& out, Linearization& lin);
  void run_chunk(const FrameInput& in, const FrameOutput& out, bool derivatives, long begin,
                 long end, int worker);
  void evaluate_callbacks(const Evaluation& out, bool derivatives);
  void add_callbacks(const FrameOutput& out, bool derivatives, long f);
  void reduce_gradient(Linearization& lin) const;

  Model model_;
  Physics physics_;
  std::vector<double> dt_;
  Objective objective_;
  std::vector<double> initial_, velocity_;
  ProblemOptions options_;
  int frame_count_, nodes_, primal_, dual_;
  std::unique_ptr<HermiteSpline> spline_;
  std::vector<Stencil> stencils_;
  std::vector<std::vector<double>> scales_;  // per dense term: sqrt(2 weight)
  std::vector<DenseTerm> terms_;
  std::vector<LocalTerm> local_terms_;
  std::vector<AlignedBuffer> scratch_;  // per worker
  std::size_t scratch_bytes_ = 0;
  std::vector<LargeVector<double>> windows_;  // per worker, of run_nodes()
  LargeVector<double> spill_;                 // per chunk, likewise
  std::vector<double> cost_;                  // N x dense terms
  std::vector<double> local_cost_;            // local terms x N
  std::vector<double> items_;                 // N: what is being summed
  std::vector<CallbackValues> callbacks_;
};

}  // namespace trajopt
