// The native interior point solver on functions that someone else traced. Each evaluation is a tape
// the core interprets, or a C callback `void call(void*)` with its argument, both passed as
// integers; either reads and writes NumPy arrays that both sides hold. Nothing here runs Python
// code between two iterations unless there is an observer.
#include "trajopt/interior_point/interior_point.h"

#include <pybind11/stl.h>

#include <cstdint>
#include <memory>
#include <optional>

#include "arrays.h"
#include "bindings.h"
#include "solve_call.h"
#include "trajopt/interior_point/tape.h"

namespace trajopt::bindings {

namespace {

namespace ip = trajopt::interior_point;

// Whoever passes memory must pass it as is: a converted copy would never see an evaluation.
using Shared = py::array_t<double, py::array::c_style>;

double* shared_memory(const py::object& value, const char* name, long size) {
  if (!py::isinstance<Shared>(value)) {
    throw ArgumentError(std::string(name) + " must be a contiguous float64 array");
  }
  auto array = py::reinterpret_borrow<Shared>(value);
  if (array.size() != size) {
    throw ArgumentError(std::string(name) + " has " + std::to_string(array.size()) +
                        " elements, expected " + std::to_string(size));
  }
  return array.mutable_data();
}

double* shared(const py::dict& d, const char* key, long size) {
  return shared_memory(d[key], key, size);
}

std::vector<double> list(const Array& a) { return {a.data(), a.data() + a.size()}; }

ip::Pattern pattern(const py::dict& d, const char* key) {
  const auto pair = d[key].cast<std::pair<std::vector<int>, std::vector<int>>>();
  return {pair.first, pair.second};
}

// (array, elements per copy) pairs of a tape's arguments or results.
template <class End>
std::vector<End> tape_ends(const py::list& pairs, int copies) {
  std::vector<End> ends;
  for (const py::handle& item : pairs) {
    const auto pair = item.cast<py::tuple>();
    const long size = pair[1].cast<long>(), step = pair[2].cast<long>();
    ends.push_back({shared_memory(pair[0], "tape", step * (copies - 1) + size), size, step});
  }
  return ends;
}

std::function<void()> tape(const py::dict& d, int copies, int threads) {
  const auto code = d["code"].cast<py::array_t<int, py::array::c_style>>();
  const auto constants = d["constants"].cast<Array>();
  if (code.ndim() != 2 || code.shape(1) != 4) {
    throw ArgumentError("code of a tape must have four columns");
  }
  std::vector<ip::Instruction> instructions;
  for (py::ssize_t k = 0; k < code.shape(0); ++k) {
    instructions.push_back({code.at(k, 0), code.at(k, 1), code.at(k, 2), code.at(k, 3)});
  }
  auto made = std::make_shared<ip::Tape>(
      std::move(instructions), list(constants), d["registers"].cast<int>(),
      tape_ends<ip::TapeInput>(d["inputs"], copies),
      tape_ends<ip::TapeOutput>(d["outputs"], copies), copies, threads);
  return [made] { made->evaluate(); };
}

// A pair of addresses (function, argument), or a tape.
std::function<void()> evaluation(const py::dict& d, const char* key, int copies, int threads) {
  if (py::isinstance<py::dict>(d[key])) return tape(d[key], copies, threads);
  const auto pair = d[key].cast<std::pair<std::uintptr_t, std::uintptr_t>>();
  // NOLINTBEGIN(performance-no-int-to-ptr): Python knows addresses as numbers only
  const auto call = reinterpret_cast<void (*)(void*)>(pair.first);
  const auto argument = reinterpret_cast<void*>(pair.second);
  // NOLINTEND(performance-no-int-to-ptr)
  if (!call) throw ArgumentError(std::string(key) + ": the function's address is null");
  return [call, argument] { call(argument); };
}

void fill_part(ip::Part& part, const ip::StagedProblem& problem, int span, const py::object& given,
               int threads) {
  part.span = span;
  if (given.is_none()) return;
  const py::dict d = given;
  part.count = d["count"].cast<int>();
  part.constraints = d["constraints"].cast<int>();
  part.jacobian = pattern(d, "jacobian_pattern");
  part.hessian = pattern(d, "hessian_pattern");
  const long count = part.count;
  part.globals = shared(d, "globals", count * problem.globals);
  part.multipliers = shared(d, "multipliers", count * part.constraints);
  part.factor = shared(d, "factor", count);
  part.cost = shared(d, "cost", count);
  part.constraint = shared(d, "constraint", count * part.constraints);
  part.gradient = shared(d, "gradient", count * problem.locals(part));
  part.jacobian_values = shared(d, "jacobian", count * part.jacobian.nonzeros());
  part.hessian_values = shared(d, "hessian", count * part.hessian.nonzeros());
  part.evaluate_values = evaluation(d, "values_call", part.count, threads);
  part.evaluate_derivatives = evaluation(d, "derivatives_call", part.count, threads);
}

Array array(const std::vector<double>& v) {
  Array a(static_cast<py::ssize_t>(v.size()));
  std::copy(v.begin(), v.end(), a.mutable_data());
  return a;
}

py::dict record(const ip::Record& r) {
  py::dict seconds;
  seconds["evaluation"] = r.seconds.evaluation;
  seconds["assembly"] = r.seconds.assembly;
  seconds["factorization"] = r.seconds.factorization;
  seconds["solve"] = r.seconds.solve;
  py::dict d;
  d["iteration"] = r.iteration;
  d["objective"] = r.objective;
  d["constraint_violation"] = r.constraint_norm;
  d["error"] = r.error;
  d["dual_infeasibility"] = r.dual_norm;
  d["complementarity"] = r.complementarity;
  d["barrier"] = r.barrier;
  d["regularization"] = r.regularization;
  d["step_norm"] = r.step_norm;
  d["step_length"] = r.primal_step;
  d["dual_step_length"] = r.dual_step;
  d["trials"] = r.trials;
  d["second_order_correction"] = r.corrected;
  d["restoration"] = r.restoration;
  d["seconds"] = seconds;
  d["elapsed"] = r.elapsed;
  return d;
}

// Ctrl-C is a stop that keeps the iterate, whether its handler raises KeyboardInterrupt or sets
// `raised` of `interrupt`; any other signal handler's exception passes on.
ip::Observer make_staged_observer(const py::object& function, const py::object& interrupt,
                                  int variables) {
  return [function, interrupt, variables](const ip::Record& r, const double* x) {
    const py::gil_scoped_acquire gil;
    if (PyErr_CheckSignals() != 0) {
      const py::error_already_set error;
      if (error.matches(PyExc_KeyboardInterrupt)) return false;
      throw error;
    }
    if (!interrupt.is_none() && interrupt.attr("raised").cast<bool>()) return false;
    if (function.is_none()) return true;
    Array copy(variables);
    std::copy_n(x, variables, copy.mutable_data());
    const py::object go = function(record(r), copy);
    return go.is_none() || go.cast<bool>();
  };
}

ip::BarrierRule parse_barrier_rule(const std::string& name) {
  if (name == "monotone") return ip::BarrierRule::monotone;
  if (name == "adaptive") return ip::BarrierRule::adaptive;
  throw ArgumentError("barrier_rule = '" + name + "': expected monotone or adaptive");
}

py::dict solve_staged(const py::dict& given, const Array& x,
                      const std::optional<Array>& multipliers,
                      const std::optional<Array>& bound_multipliers, const py::object& observer,
                      const py::object& interrupt, double tolerance, int max_iterations,
                      double barrier, const std::string& barrier_rule, double bound_push,
                      bool warm_start, bool scale, int refinements, int threads,
                      const std::string& ordering) {
  ip::StagedProblem problem;
  problem.nodes = given["nodes"].cast<int>();
  problem.node_size = given["node_size"].cast<int>();
  problem.globals = given["globals"].cast<int>();
  problem.x = shared(given, "x", static_cast<long>(problem.nodes) * problem.node_size);
  problem.lower = list(given["lower"].cast<Array>());
  problem.upper = list(given["upper"].cast<Array>());
  problem.constraint_lower = list(given["constraint_lower"].cast<Array>());
  problem.constraint_upper = list(given["constraint_upper"].cast<Array>());
  fill_part(problem.stages, problem, 2, given["stages"], threads);
  fill_part(problem.last, problem, 1, given["last"], threads);
  fill_part(problem.global, problem, 0, given["global"], threads);
  const ip::Options options{.tolerance = tolerance,
                            .max_iterations = max_iterations,
                            .barrier = barrier,
                            .barrier_rule = parse_barrier_rule(barrier_rule),
                            .bound_push = bound_push,
                            .warm_start = warm_start,
                            .scale = scale,
                            .refinements = refinements,
                            .threads = threads,
                            .ordering = parse_ordering(ordering)};
  ip::Point point{list(x), {}, {}};
  if (multipliers) point.multipliers = list(*multipliers);
  if (bound_multipliers) point.bound_multipliers = list(*bound_multipliers);
  const ip::Observer watch = make_staged_observer(observer, interrupt, problem.variables());
  ip::Outcome outcome;
  {
    const py::gil_scoped_release release;
    outcome = ip::solve(problem, options, point, watch);
  }
  py::list history;
  for (const ip::Record& r : outcome.history) history.append(record(r));
  py::dict d;
  d["status"] = status_name(outcome.status);
  d["message"] = outcome.message;
  d["iterations"] = outcome.iterations;
  d["objective"] = outcome.objective;
  d["x"] = array(point.x);
  d["multipliers"] = array(point.multipliers);
  d["bound_multipliers"] = array(point.bound_multipliers);
  d["violation"] = array(outcome.violation);
  d["history"] = history;
  return d;
}

}  // namespace

void register_interior_point(py::module_& m) {
  using namespace py::literals;  // NOLINT(google-build-using-namespace)
  const ip::Options o;
  m.def(
      "evaluate_tape",
      [](const py::dict& d, int copies, int threads) { tape(d, copies, threads)(); }, "tape"_a,
      "copies"_a, "threads"_a = 1, "Runs a tape once over the memory it names.");
  m.def("solve_staged", &solve_staged, "problem"_a, "x"_a, "multipliers"_a = py::none(),
        "bound_multipliers"_a = py::none(), "observer"_a = py::none(), "interrupt"_a = py::none(),
        py::kw_only(), "tolerance"_a = o.tolerance, "max_iterations"_a = o.max_iterations,
        "barrier"_a = o.barrier, "barrier_rule"_a = "monotone", "bound_push"_a = o.bound_push,
        "warm_start"_a = o.warm_start, "scale"_a = o.scale, "refinements"_a = o.refinements,
        "threads"_a = o.threads, "ordering"_a = "auto",
        "Interior point method for a staged nonlinear program; see trajopt.collocation.native.");
}

}  // namespace trajopt::bindings
