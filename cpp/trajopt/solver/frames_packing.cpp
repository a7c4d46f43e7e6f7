#include "trajopt/solver/frames_packing.h"

#include <algorithm>

namespace trajopt {

namespace {

ModelView pack_model(Parcel& parcel, const ModelView& m) {
  static_assert(sizeof(ModelView) == 10 * sizeof(int) + sizeof(double) + 12 * sizeof(void*),
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
  v.hulls = parcel.add(m.hulls, m.nhull);
  v.runs = parcel.add(m.runs, m.nrun);
  return v;
}

FrameInput pack_input(Parcel& parcel, const TrajectoryProblem& p, double augmentation) {
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

const LocalTerm* pack_local(Parcel& parcel, const TrajectoryProblem& p) {
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

// Its rotations lie elsewhere: they are computed.
SplineView pack_spline(Parcel& parcel, const HermiteSpline& spline, int dofs) {
  SplineView v = spline.view();
  v.runs = parcel.add(v.runs, v.nruns);
  v.weights = parcel.add(v.weights, 4UL * v.per_segment);
  v.plain = parcel.add(v.plain, 4UL * v.per_segment * dofs);
  v.rotations = nullptr;
  return v;
}

const CallbackTerm* pack_callbacks(Parcel& parcel, const TrajectoryProblem& p) {
  std::vector<CallbackTerm> terms;
  long first = 0;
  for (const CallbackObjective& term : p.objective().callbacks) {
    terms.push_back({first, term.rows, term.weight});
    first += static_cast<long>(p.frame_count()) * term.rows;
  }
  return parcel.add(terms.data(), terms.size());
}

}  // namespace

void pack_problem(Parcel& parcel, const TrajectoryProblem& problem, const ExecutorOptions& options,
                  FramesSystem& system) {
  system.frame_count = problem.frame_count();
  system.in = pack_input(parcel, problem, options.augmentation);
  system.local = pack_local(parcel, problem);
  system.nlocal = static_cast<int>(problem.local_terms().size());
  system.callback = pack_callbacks(parcel, problem);
  system.ncallback = static_cast<int>(problem.objective().callbacks.size());
  system.ring = problem.options().periodic;
  std::copy_n(problem.options().stride, 3, system.stride);
  const bool splined = problem.options().formulation == Formulation::spline;
  system.spline =
      splined ? pack_spline(parcel, problem.spline(), problem.model().ndof) : SplineView{};
  system.velocity =
      splined ? parcel.add(problem.velocity().data(), problem.velocity().size()) : nullptr;
  system.smoothing = splined ? 0.0 : options.smoothing;  // as KktSystem
  system.epsilon = options.epsilon;
}

std::size_t rank_scratch_bytes(const std::vector<BatchMember>& members, double augmentation) {
  std::size_t most = 0;
  for (const BatchMember& m : members) {
    const FrameInput in = m.problem->frame_input(nullptr, augmentation);
    most = std::max(most, group_scratch_bytes(in));
  }
  return (most + 127) / 128 * 128;  // whole cache lines, so that neighbouring frames share none
}

}  // namespace trajopt
