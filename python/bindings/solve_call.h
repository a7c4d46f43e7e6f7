// What every solver binding does: records and observers across the language border.
#pragma once

#include <pybind11/stl.h>

#include <memory>
#include <string>

#include "arrays.h"
#include "linalg_arrays.h"
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
  d["ordering"] = linalg::ordering_name(r.ordering);
  return d;
}

// Lets Python's signal handlers run. False after Ctrl-C, which is a stop that keeps the iterate;
// any other handler's exception passes on.
inline bool undisturbed() {
  if (PyErr_CheckSignals() == 0) return true;
  const py::error_already_set error;
  if (error.matches(PyExc_KeyboardInterrupt)) return false;
  throw error;
}

// A Python function in the hands of code that copies it without the GIL: what is copied is the
// pointer, and whoever drops it last takes the GIL.
inline std::shared_ptr<const py::object> hold(const py::object& function) {
  return {new py::object(function), [](const py::object* held) {
            const py::gil_scoped_acquire gil;
            delete held;
          }};
}

// Wraps a Python observer, for which it takes the GIL.
inline Observer make_observer(const py::object& function) {
  return [held = hold(function)](const IterationRecord& record, const State& state) {
    const py::gil_scoped_acquire gil;
    if (!undisturbed()) return false;
    if (held->is_none()) return true;
    const py::object go = (*held)(record_dict(record), to_array(state));
    return go.is_none() || go.cast<bool>();
  };
}

// solve(problem, options, state, observer) without the GIL; (status, message, iterations, state,
// ordering).
template <class Solve, class Options>
py::tuple run_solver(Solve solve, TrajectoryProblem& problem, const Options& options,
                     const Array& initial, const py::object& observer) {
  State state = to_vector(initial);
  const Observer watch = make_observer(observer);
  Result result;
  {
    const py::gil_scoped_release release;
    result = solve(problem, options, state, watch);
  }
  return py::make_tuple(status_name(result.status), result.message, result.iterations,
                        to_array(state), linalg::ordering_name(result.ordering));
}

}  // namespace trajopt::bindings
