#include "bindings.h"
#include "solve_call.h"
#include "trajopt/base/error.h"
#include "trajopt/solver/funnel_sqp.h"
#ifdef TRAJOPT_WITH_CUDA
#include "trajopt/cuda/solver/executor.h"
#endif

namespace trajopt::bindings {

namespace {

std::unique_ptr<SqpExecutor> make_executor(const std::string& device, TrajectoryProblem& problem,
                                           const FunnelOptions& options, State& state) {
  if (device == "cpu") return make_cpu_executor(problem, executor_options(options), state);
  if (device != "cuda") {
    throw ArgumentError("device is '" + device + "', expected 'cpu' or 'cuda'");
  }
#ifdef TRAJOPT_WITH_CUDA
  return cuda::make_executor(problem, executor_options(options), state);
#else
  throw DeviceError("device cuda: this package was built without CUDA");
#endif
}

}  // namespace

void register_solver(py::module_& m) {
  using namespace py::literals;  // NOLINT(google-build-using-namespace)
  const FunnelOptions f;
  m.def(
      "solve_funnel",
      [](TrajectoryProblem& problem, const Array& state, const py::object& observer,
         int max_iterations, double constraint_tolerance, double objective_tolerance, int window,
         double funnel, double smoothing, double damping, double augmentation, double epsilon,
         double normal_radius, int corrections, bool restore, const std::string& ordering,
         const std::string& device) {
        const FunnelOptions options{max_iterations,
                                    constraint_tolerance,
                                    objective_tolerance,
                                    window,
                                    funnel,
                                    smoothing,
                                    damping,
                                    augmentation,
                                    epsilon,
                                    normal_radius,
                                    corrections,
                                    restore,
                                    parse_ordering(ordering)};
        const auto solve = [&device](TrajectoryProblem& on, const FunnelOptions& with, State& from,
                                     const Observer& watch) {
          const auto executor = make_executor(device, on, with, from);
          return solve_funnel(*executor, with, watch);
        };
        return run_solver(solve, problem, options, state, observer);
      },
      "problem"_a, "state"_a, "observer"_a = py::none(), py::kw_only(),
      "max_iterations"_a = f.max_iterations, "constraint_tolerance"_a = f.constraint_tolerance,
      "objective_tolerance"_a = f.objective_tolerance, "window"_a = f.window, "funnel"_a = f.funnel,
      "smoothing"_a = f.smoothing, "damping"_a = f.damping, "augmentation"_a = f.augmentation,
      "epsilon"_a = f.epsilon, "normal_radius"_a = f.normal_radius, "corrections"_a = f.corrections,
      "restore"_a = f.restore, "ordering"_a = "auto", "device"_a = "cpu");
}

}  // namespace trajopt::bindings
