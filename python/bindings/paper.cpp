#include "bindings.h"
#include "solve_call.h"
#include "trajopt/solver/paper_sqp.h"

namespace trajopt::bindings {

void register_paper(py::module_& m) {
  using namespace py::literals;  // NOLINT(google-build-using-namespace)
  const PaperOptions o;
  m.def(
      "solve_paper",
      [](TrajectoryProblem& problem, const Array& state, const py::object& observer,
         int max_iterations, double constraint_limit, double constraint_tolerance,
         double step_tolerance, double growth, double shrink, double normal_share, double penalty,
         double damping, double epsilon, int conjugate_gradient_steps, double smallest_radius,
         const std::string& ordering) {
        const PaperOptions options{.max_iterations = max_iterations,
                                   .constraint_limit = constraint_limit,
                                   .constraint_tolerance = constraint_tolerance,
                                   .step_tolerance = step_tolerance,
                                   .growth = growth,
                                   .shrink = shrink,
                                   .normal_share = normal_share,
                                   .penalty = penalty,
                                   .damping = damping,
                                   .epsilon = epsilon,
                                   .conjugate_gradient_steps = conjugate_gradient_steps,
                                   .smallest_radius = smallest_radius,
                                   .ordering = parse_ordering(ordering)};
        return run_solver(solve_paper, problem, options, state, observer);
      },
      "problem"_a, "state"_a, "observer"_a = py::none(), py::kw_only(),
      "max_iterations"_a = o.max_iterations, "constraint_limit"_a = o.constraint_limit,
      "constraint_tolerance"_a = o.constraint_tolerance, "step_tolerance"_a = o.step_tolerance,
      "growth"_a = o.growth, "shrink"_a = o.shrink, "normal_share"_a = o.normal_share,
      "penalty"_a = o.penalty, "damping"_a = o.damping, "epsilon"_a = o.epsilon,
      "conjugate_gradient_steps"_a = o.conjugate_gradient_steps,
      "smallest_radius"_a = o.smallest_radius, "ordering"_a = "auto",
      "Pan's Algorithm 1; C_max, eps_C and eps_E in the problem's own units.");
}

}  // namespace trajopt::bindings
