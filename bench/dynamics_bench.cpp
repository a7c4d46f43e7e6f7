// Time per frame on one core of the dynamics residual, its Jacobians, and a whole linearization
// with the terms of mammal-walk, in flight, standing on every foot, and walking; and of a whole
// iteration of the solver, in its phases, as a motion gets longer.
//
// TRAJOPT_ISA=avx2 or portable in the environment measures the other instruction sets.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <functional>
#include <string>
#include <vector>

#include "character_data.h"
#include "trajopt/base/buffer.h"
#include "trajopt/dynamics/batch.h"
#include "trajopt/problem/trajectory_problem.h"
#include "trajopt/solver/funnel_sqp.h"

namespace {

using namespace trajopt;

enum class Where { flight, stand, walk };

// A motion of n + 2 frames (x_{-1}, x_0, x_1 ...): the gait over and over, or the settled pose with
// every joint swaying by a hundredth of a radian, on the ground or well above it.
struct Motion {
  bench::Character character;
  std::vector<double> frames, dt;
  std::vector<Stencil> stencils;

  Motion(const std::string& name, Where where, long n)
      : character(bench::read_character(where == Where::walk ? name + "-walk" : name)),
        dt(n + 1, character.dt) {
    const Model& m = character.model;
    const long given = static_cast<long>(character.frames.size()) / m.nq;
    frames.resize((n + 2) * m.nq);
    std::vector<double> step(m.ndof);
    for (long i = 0; i < n + 2; ++i) {
      const double* from = character.frames.data() + (i % given) * m.nq;
      if (where != Where::walk)
        for (int j = 0; j < m.ndof; ++j) step[j] = j == 2 ? 0 : 0.01 * std::sin(0.3 * i + j);
      if (where == Where::flight) step[2] = 2;
      integrate(m, from, step.data(), frames.data() + i * m.nq);
    }
    for (long i = 0; i < n; ++i)
      stencils.push_back(make_stencil(character.physics, character.dt, character.dt));
  }
};

Objective walking_terms(const Model& model, long n) {
  Objective o;
  const auto add = [&](const char* name, DenseKind kind, double weight) {
    DenseObjective term{name, {}, std::vector<double>(n, weight / n), {}};
    term.term.kind = kind;
    if (kind == DenseKind::center_of_mass_velocity) {
      term.target.assign(3 * n, 0.0);
      for (long i = 0; i < n; ++i) term.target[3 * i] = 0.3;
    }
    o.dense.push_back(term);
  };
  add("center_of_mass_velocity", DenseKind::center_of_mass_velocity, 1.0);
  add("effort", DenseKind::effort, 0.1);
  add("contact_rate", DenseKind::contact_rate, 0.03);
  add("contact_slip", DenseKind::contact_slip, 100.0);
  o.local.push_back({"smoothness",
                     LocalKind::acceleration,
                     std::vector<double>(n, 5e-3 / n),
                     std::vector<double>(model.ndof, 1.0),
                     {}});
  return o;
}

void per_frame(benchmark::State& state, long n) {
  state.counters["us/frame"] =
      benchmark::Counter(static_cast<double>(state.iterations()) * n * 1e-6,
                         benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}

// The kernels by themselves: `derivatives` writes window Hessian, gradient and constraint rows.
void kernel(benchmark::State& state, const std::string& name, Where where, bool terms,
            bool derivatives) {
  const long n = 128;
  Motion motion(name, where, n);
  const Model& m = motion.character.model;
  const long d = m.ndof, rows = static_cast<long>(m.unactuated.size());
  const Objective objective = walking_terms(m, n);
  std::vector<DenseTerm> dense;
  for (const DenseObjective& o : objective.dense) {
    dense.push_back(o.term);
    dense.back().scale = o.weight.data();
    dense.back().target = o.target.empty() ? nullptr : o.target.data();
  }
  const FrameInput in{view(m),
                      &motion.character.physics,
                      motion.stencils.data(),
                      motion.dt.data(),
                      motion.frames.data(),
                      dense.data(),
                      terms ? static_cast<int>(dense.size()) : 0,
                      terms ? 1e-3 : 0.0};
  std::vector<double> constraint(n * rows), torque(n * m.actuated.size()), cost(n * dense.size()),
      hessian(n * 6 * d * d), gradient(n * 3 * d), jacobian(n * 3 * rows * d);
  const FrameOutput out{constraint.data(), torque.data(),   cost.data(),
                        hessian.data(),    gradient.data(), jacobian.data()};
  const FrameKernels& kernels = frame_kernels();
  const AlignedBuffer scratch = aligned_buffer(kernels.scratch_bytes(in));
  const auto run = derivatives ? kernels.linearize : kernels.evaluate;
  for (auto _ : state) {
    for (long i = 0; i < n; i += kernels.lanes)
      run(in, i, static_cast<int>(std::min<long>(kernels.lanes, n - i)), scratch.get(), out);
    benchmark::ClobberMemory();
  }
  per_frame(state, n);
}

// What Model.dynamics_residual and Model.dynamics_jacobians run: rotation vectors, whole Jacobians.
void batch(benchmark::State& state, const std::string& name, Where where, bool derivatives) {
  const long n = 128;
  Motion motion(name, where, n);
  const Model& m = motion.character.model;
  const long d = m.ndof;
  std::vector<double> x((n + 2) * d), fd(n * d), jacobians[3];
  for (long i = 0; i < n + 2; ++i)
    configuration_to_vector(m, motion.frames.data() + i * m.nq, x.data() + i * d);
  DynamicsBatch b{.count = n,
                  .x = x.data() + 2 * d,
                  .x1 = x.data() + d,
                  .x2 = x.data(),
                  .dt = motion.dt.data(),
                  .dt_before = motion.dt.data(),
                  .fd = fd.data()};
  for (int q = 0; derivatives && q < 3; ++q) {
    jacobians[q].resize(n * d * d);
    b.jacobians[q] = jacobians[q].data();
  }
  for (auto _ : state) {
    dynamics_batch(m, motion.character.physics, b, 1);
    benchmark::ClobberMemory();
  }
  per_frame(state, n);
}

// The whole of TrajectoryProblem::linearize or evaluate, local terms and sums over frames included.
void problem(benchmark::State& state, bool derivatives) {
  const long n = state.range(0);
  const Motion motion("mammal", Where::walk, n);
  const Model& m = motion.character.model;
  TrajectoryProblem p(m, motion.character.physics, motion.dt, walking_terms(m, n),
                      {motion.frames.begin(), motion.frames.begin() + 2 * m.nq},
                      std::vector<double>(m.ndof, 0.0), {});
  const State at = p.state_from_frames(motion.frames.data() + 2 * m.nq);
  Evaluation e;
  Linearization lin;
  p.linearize(at, 1e-3, e, lin);  // the first pages of a large motion cost more than its frames
  for (auto _ : state) {
    if (derivatives) {
      p.linearize(at, 1e-3, e, lin);
    } else {
      p.evaluate(at, e);
    }
  }
  per_frame(state, n);
}

// An iteration with everything in it: linearize, assemble, factor, both steps, a trial and two
// corrections. The work is the same in every round and for every length.
void iteration(benchmark::State& state) {
  const long n = state.range(0);
  const Motion motion("mammal", Where::walk, n);
  const Model& m = motion.character.model;
  ProblemOptions options;
  options.threads = static_cast<int>(state.range(1));
  TrajectoryProblem p(m, motion.character.physics, motion.dt, walking_terms(m, n),
                      {motion.frames.begin(), motion.frames.begin() + 2 * m.nq},
                      std::vector<double>(m.ndof, 0.0), options);
  State at = p.state_from_frames(motion.frames.data() + 2 * m.nq);
  const FunnelOptions funnel;
  const auto executor = make_cpu_executor(p, executor_options(funnel), at);
  const auto round = [&] {
    using Kind = Request::Kind;
    executor->answer({.kind = Kind::linearize});
    if (!executor->answer({.kind = Kind::steps, .damping = funnel.damping}).factored) return false;
    executor->answer({.kind = Kind::trial, .tangential = 1.0, .normal = 0.1});
    executor->answer({.kind = Kind::correction, .zeta = 0.1});
    executor->answer({.kind = Kind::correction, .zeta = 0.1});
    return true;
  };
  if (!round()) {  // also touches all memory
    state.SkipWithError(executor->error().c_str());
    return;
  }
  executor->take_seconds();
  PhaseSeconds least{1e9, 1e9, 1e9, 1e9};
  for (auto _ : state) {
    round();
    const PhaseSeconds s = executor->take_seconds();
    least = {std::min(least.dynamics, s.dynamics), std::min(least.assembly, s.assembly),
             std::min(least.factorization, s.factorization), std::min(least.solve, s.solve)};
  }
  const double scale = 1e6 / static_cast<double>(n);  // of the best round, us/frame
  state.counters["dynamics"] = least.dynamics * scale;
  state.counters["assembly"] = least.assembly * scale;
  state.counters["factor"] = least.factorization * scale;
  state.counters["solve"] = least.solve * scale;
  state.counters["all"] =
      (least.dynamics + least.assembly + least.factorization + least.solve) * scale;
}

void register_all() {
  const std::pair<const char*, Where> places[] = {
      {"flight", Where::flight}, {"stand", Where::stand}, {"walk", Where::walk}};
  for (const std::string name : {"mammal", "humanoid"}) {
    for (const auto& place : places) {
      const char* label = place.first;
      const Where where = place.second;
      if (where == Where::walk && name != "mammal") continue;
      const std::string end = "/" + name + "/" + label;
      for (bool j : {false, true}) {
        benchmark::RegisterBenchmark(((j ? "jacobians" : "residual") + end).c_str(),
                                     [=](benchmark::State& s) { batch(s, name, where, j); });
        benchmark::RegisterBenchmark(((j ? "linearize" : "evaluate") + end).c_str(),
                                     [=](benchmark::State& s) { kernel(s, name, where, true, j); });
      }
    }
  }
  for (bool j : {false, true}) {
    auto* b = benchmark::RegisterBenchmark(
        j ? "problem_linearize/mammal/walk" : "problem_evaluate/mammal/walk",
        [j](benchmark::State& s) { problem(s, j); });
    for (long n : {400, 1000, 10000, 100000}) b->Arg(n);
    b->Unit(benchmark::kMillisecond);
  }
  auto* b = benchmark::RegisterBenchmark("iteration/mammal/walk", iteration);
  b->ArgNames({"n", "threads"})->Unit(benchmark::kMillisecond)->UseRealTime();
  for (long threads : {1, 2})
    for (long n : {400, 1000, 4000, 10000, 40000, 100000}) b->Args({n, threads});
}

}  // namespace

int main(int argc, char** argv) {
  register_all();
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
