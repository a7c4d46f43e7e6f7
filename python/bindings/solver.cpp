#include "trajopt/solver/solver.h"

#include <pybind11/functional.h>
#include <pybind11/stl.h>

#include <cstring>

#include "arrays.h"
#include "bindings.h"
#include "trajopt/solver/funnel_sqp.h"

namespace trajopt::bindings {

namespace {

py::dict record_dict(const IterationRecord& r) {
  py::dict seconds;
  seconds["dynamics"] = r.seconds.dynamics;
  seconds["assembly"] = r.seconds.assembly;
  seconds["factorization"] = r.seconds.factorization;
  seconds["solve"] = r.seconds.solve;
  py::dict d;
  d["iteration"] = r.iteration;
  d["objective"] = r.objective;
  d["terms"] = r.terms;
  d["constraint_violation"] = r.constraint_norm;
  d["frame_violation"] = r.frame_violation;
  d["penalty"] = r.penalty;
  d["radius"] = r.radius;
  d["damping"] = r.damping;
  d["step_norm"] = r.step_norm;
  d["gain_ratio"] = r.gain_ratio;
  d["accepted"] = r.accepted;
  d["seconds"] = seconds;
  d["elapsed"] = r.elapsed;
  return d;
}

py::array_t<double> state_array(const State& state) {
  py::array_t<double> out(static_cast<py::ssize_t>(state.size()));
  std::memcpy(out.mutable_data(), state.data(), state.size() * sizeof(double));
  return out;
}

// Wraps a Python observer: takes the GIL, and turns Ctrl-C into a stop that keeps the iterate.
Observer make_observer(const py::object& function) {
  return [function](const IterationRecord& record, const State& state) {
    const py::gil_scoped_acquire gil;
    if (PyErr_CheckSignals() != 0) {
      const py::error_already_set error;
      if (error.matches(PyExc_KeyboardInterrupt)) return false;
      throw error;
    }
    if (function.is_none()) return true;
    const py::object go = function(record_dict(record), state_array(state));
    return go.is_none() || go.cast<bool>();
  };
}

template <class Solve, class Options>
py::tuple run(Solve solve, TrajectoryProblem& problem, const Options& options, const Array& initial,
              const py::object& observer) {
  State state(initial.data(), initial.data() + initial.size());
  const Observer watch = make_observer(observer);
  Result result;
  {
    const py::gil_scoped_release release;
    result = solve(problem, options, state, watch);
  }
  return py::make_tuple(status_name(result.status), result.message, result.iterations,
                        state_array(state));
}

linalg::Ordering parse_ordering(const std::string& name) {
  if (name == "auto") return linalg::Ordering::automatic;
  if (name == "sequential") return linalg::Ordering::sequential;
  if (name == "cyclic") return linalg::Ordering::cyclic;
  if (name == "chunked") return linalg::Ordering::chunked;
  throw ArgumentError("ordering = '" + name +
                      "': expected auto, sequential, cyclic or chunked");
}

}  // namespace

void register_solver(py::module_& m) {
  using namespace py::literals;  // NOLINT(google-build-using-namespace)
  const FunnelOptions f;
  m.def("solve_funnel",
        [](TrajectoryProblem& problem, const Array& state, const py::object& observer,
           int max_iterations, double constraint_tolerance, double objective_tolerance, int window,
           double funnel, double smoothing, double damping, double augmentation, double epsilon,
           double normal_radius, int corrections, bool restore, const std::string& ordering) {
          const FunnelOptions options{max_iterations, constraint_tolerance, objective_tolerance,
                                      window,         funnel,               smoothing,
                                      damping,        augmentation,         epsilon,
                                      normal_radius,  corrections,          restore,
                                      parse_ordering(ordering)};
          return run(solve_funnel, problem, options, state, observer);
        },
        "problem"_a, "state"_a, "observer"_a = py::none(), py::kw_only(),
        "max_iterations"_a = f.max_iterations, "constraint_tolerance"_a = f.constraint_tolerance,
        "objective_tolerance"_a = f.objective_tolerance, "window"_a = f.window,
        "funnel"_a = f.funnel, "smoothing"_a = f.smoothing, "damping"_a = f.damping,
        "augmentation"_a = f.augmentation, "epsilon"_a = f.epsilon,
        "normal_radius"_a = f.normal_radius, "corrections"_a = f.corrections,
        "restore"_a = f.restore, "ordering"_a = "auto");
}

}  // namespace trajopt::bindings
