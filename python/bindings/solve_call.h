// What every solver binding does: records and observers across the language border.
#pragma once

#include <pybind11/stl.h>

#include <cstring>
#include <string>

#include "arrays.h"
#include "trajopt/solver/solver.h"

namespace trajopt::bindings {

inline py::dict record_dict(const IterationRecord& r) {
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

inline py::array_t<double> state_array(const State& state) {
  py::array_t<double> out(static_cast<py::ssize_t>(state.size()));
  std::memcpy(out.mutable_data(), state.data(), state.size() * sizeof(double));
  return out;
}

// Wraps a Python observer: takes the GIL, and turns Ctrl-C into a stop that keeps the iterate.
inline Observer make_observer(const py::object& function) {
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

inline linalg::Ordering parse_ordering(const std::string& name) {
  if (name == "auto") return linalg::Ordering::automatic;
  if (name == "sequential") return linalg::Ordering::sequential;
  if (name == "cyclic") return linalg::Ordering::cyclic;
  if (name == "chunked") return linalg::Ordering::chunked;
  throw ArgumentError("ordering = '" + name + "': expected auto, sequential, cyclic or chunked");
}

// solve(problem, options, state, observer) without the GIL; (status, message, iterations, state).
template <class Solve, class Options>
py::tuple run_solver(Solve solve, TrajectoryProblem& problem, const Options& options,
                     const Array& initial, const py::object& observer) {
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

}  // namespace trajopt::bindings
