#include <pybind11/functional.h>
#include <pybind11/stl.h>

#include <algorithm>

#include "arrays.h"
#include "bindings.h"
#include "trajopt/model/configuration.h"
#include "trajopt/problem/trajectory_problem.h"

namespace trajopt::bindings {

namespace {

DenseKind parse_dense(const std::string& name) {
  static const std::pair<const char*, DenseKind> kNames[] = {
      {"center_of_mass_velocity", DenseKind::center_of_mass_velocity},
      {"center_of_mass_position", DenseKind::center_of_mass_position},
      {"effort", DenseKind::effort},
      {"physics", DenseKind::physics},
      {"point_position", DenseKind::point_position},
      {"point_velocity", DenseKind::point_velocity},
      {"contact_rate", DenseKind::contact_rate},
      {"contact_slip", DenseKind::contact_slip},
      {"contact_impact", DenseKind::contact_impact}};
  for (const auto& [text, kind] : kNames)
    if (name == text) return kind;
  throw ArgumentError("kind = '" + name + "': unknown objective term");
}

LocalKind parse_local(const std::string& name) {
  if (name == "pose") return LocalKind::pose;
  if (name == "velocity") return LocalKind::velocity;
  if (name == "acceleration") return LocalKind::acceleration;
  throw ArgumentError("kind = '" + name + "': expected pose, velocity or acceleration");
}

// The function is called with a copy of the frames (N + 2, nq) and whether derivatives are wanted;
// it returns residuals (N, rows), and with derivatives also (N, rows, 3D).
CallbackObjective make_callback(const std::string& name, int rows, double weight, int frames,
                                const Model& model, const py::function& function) {
  const long n = frames, nq = model.nq, d = model.ndof;
  auto call = [=](const double* at, double* residual, double* jacobian) {
    const py::gil_scoped_acquire gil;
    const py::array_t<double> q({n + 2, nq}, at);
    const auto result = function(q, jacobian != nullptr).cast<py::tuple>();
    const auto take = [&](std::size_t k, const std::vector<long>& shape, const char* what,
                          double* to) {
      if (k >= result.size()) throw ArgumentError(std::string(what) + " is missing");
      const Array values = result[k].cast<Array>();
      require_shape(values, shape, what);
      std::copy_n(values.data(), values.size(), to);
    };
    take(0, {n, rows}, "residual of a callback", residual);
    if (jacobian != nullptr) take(1, {n, rows, 3 * d}, "Jacobian of a callback", jacobian);
  };
  return {name, rows, frames, weight, call};
}

py::dict evaluation_dict(const TrajectoryProblem& p, const Evaluation& e) {
  const long n = p.frame_count(), nq = p.model().nq;
  py::dict d;
  d["objective"] = e.objective;
  d["terms"] = e.terms;
  d["frames"] = to_array(e.frames, {n + 2, nq});
  d["frame_constraint"] =
      to_array(e.frame_constraint, {n, static_cast<long>(p.model().unactuated.size())});
  d["constraint"] = to_array(e.constraint, {p.nodes(), p.dual()});
  d["torque"] = to_array(e.torque, {n, static_cast<long>(p.model().actuated.size())});
  d["constraint_norm"] = e.constraint_norm;
  d["frame_violation"] = e.frame_violation;
  return d;
}

template <void (*Convert)(const Model&, const double*, double*)>
py::array_t<double> convert(const Model& model, const Array& in, long from, long to,
                            const char* name) {
  require_shape(in, {-1, from}, name);
  auto out = empty({in.shape(0), to});
  for (long i = 0; i < in.shape(0); ++i)
    Convert(model, in.data() + i * from, out.mutable_data() + i * to);
  return out;
}

}  // namespace

void register_problem(py::module_& m) {
  using namespace py::literals;  // NOLINT(google-build-using-namespace)
  m.def(
      "configuration_from_vector",
      [](const Model& model, const Array& x) {
        return convert<configuration_from_vector>(model, x, model.ndof, model.nq, "x");
      },
      "model"_a, "x"_a, "Rotation vectors (n, D) to quaternions (n, nq).");
  m.def(
      "configuration_to_vector",
      [](const Model& model, const Array& q) {
        return convert<configuration_to_vector>(model, q, model.nq, model.ndof, "q");
      },
      "model"_a, "q"_a, "Quaternions (n, nq) to rotation vectors (n, D) of at most pi.");

  py::class_<Objective>(m, "Objective")
      .def(py::init<>())
      .def("names", &Objective::names)
      .def(
          "add_dense",
          [](Objective& o, const std::string& name, const std::string& kind, const Array& weight,
             const std::optional<Array>& target, int joint, const std::array<double, 3>& point,
             const std::array<double, 3>& axes) {
            DenseObjective term{
                .name = name, .term = {}, .weight = to_vector(weight), .target = {}};
            term.term.kind = parse_dense(kind);
            term.term.joint = joint;
            for (int k = 0; k < 3; ++k) {
              term.term.point[k] = point[k];
              term.term.axes[k] = axes[k];
            }
            if (target) {
              require_shape(*target, {weight.size(), 3}, "target");
              term.target = to_vector(*target);
            }
            o.dense.push_back(std::move(term));
          },
          "name"_a, "kind"_a, "weight"_a, "target"_a = py::none(), "joint"_a = 0,
          "point"_a = std::array<double, 3>{0, 0, 0}, "axes"_a = std::array<double, 3>{1, 1, 1})
      .def(
          "add_local",
          [](Objective& o, const std::string& name, const std::string& kind, const Array& weight,
             const Array& dof_weight, const std::optional<Array>& target) {
            o.local.push_back({name, parse_local(kind), to_vector(weight), to_vector(dof_weight),
                               target ? to_vector(*target) : std::vector<double>{}});
          },
          "name"_a, "kind"_a, "weight"_a, "dof_weight"_a, "target"_a = py::none())
      .def(
          "add_callback",
          [](Objective& o, const std::string& name, int rows, double weight, int frames,
             const Model& model, const py::function& function) {
            o.callbacks.push_back(make_callback(name, rows, weight, frames, model, function));
          },
          "name"_a, "rows"_a, "weight"_a, "frames"_a, "model"_a, "function"_a);

  py::class_<TrajectoryProblem>(m, "TrajectoryProblem")
      .def(py::init([](const Model& model, const Physics& physics, const Array& dt,
                       const Objective& objective, const Array& initial, const Array& velocity,
                       const std::string& formulation, int frames_per_knot, bool periodic,
                       const std::array<double, 3>& stride, int threads) {
             require_shape(initial, {2, model.nq}, "initial");
             require_shape(velocity, {model.ndof}, "velocity");
             ProblemOptions options;
             options.formulation =
                 formulation == "spline" ? Formulation::spline : Formulation::frames;
             options.frames_per_knot = frames_per_knot;
             options.periodic = periodic;
             for (int k = 0; k < 3; ++k) options.stride[k] = stride[k];
             options.threads = threads;
             return std::make_unique<TrajectoryProblem>(model, physics, to_vector(dt), objective,
                                                        to_vector(initial), to_vector(velocity),
                                                        options);
           }),
           py::kw_only(), "model"_a, "physics"_a, "dt"_a, "objective"_a, "initial"_a, "velocity"_a,
           "formulation"_a = "frames", "frames_per_knot"_a = 10, "periodic"_a = false,
           "stride"_a = std::array<double, 3>{0, 0, 0}, "threads"_a = 1)
      .def_property_readonly("nodes", &TrajectoryProblem::nodes)
      .def_property_readonly("primal", &TrajectoryProblem::primal)
      .def_property_readonly("dual", &TrajectoryProblem::dual)
      .def(
          "state_from_frames",
          [](const TrajectoryProblem& p, const Array& frames) {
            require_shape(frames, {p.frame_count(), p.model().nq}, "frames");
            const State s = p.state_from_frames(frames.data());
            return to_array(s);
          },
          "frames"_a, "State whose frames 1..N are (or are splined through) the given (N, nq).")
      .def(
          "evaluate",
          [](TrajectoryProblem& p, const Array& state) {
            Evaluation e;
            const State s = to_vector(state);
            {
              const py::gil_scoped_release release;
              p.evaluate(s, e);
            }
            return evaluation_dict(p, e);
          },
          "state"_a)
      .def(
          "retract",
          [](const TrajectoryProblem& p, const Array& state, const Array& step) {
            require_shape(step, {static_cast<long>(p.nodes()) * p.primal()}, "step");
            State out;
            p.retract(to_vector(state), step.data(), out);
            return to_array(out);
          },
          "state"_a, "step"_a)
      .def(
          "linearize",
          [](TrajectoryProblem& p, const Array& state) {
            Evaluation e;
            Linearization lin;
            p.linearize(to_vector(state), 0.0, e, lin);
            py::dict d = evaluation_dict(p, e);
            d["gradient"] = to_array(lin.node_gradient, {p.nodes(), p.primal()});
            return d;
          },
          "state"_a);
}

}  // namespace trajopt::bindings
