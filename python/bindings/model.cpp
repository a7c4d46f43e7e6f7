#include "trajopt/model/model.h"

#include <pybind11/stl.h>

#include <array>
#include <optional>

#include "arrays.h"
#include "bindings.h"
#include "trajopt/base/parallel.h"
#include "trajopt/dynamics/batch.h"

namespace trajopt::bindings {

namespace {

Model make_model(const IntArray& joint_type, const IntArray& joint_parent, const Array& offset,
                 const Array& axis, const Array& inertia, const Array& lower, const Array& upper,
                 const py::array_t<bool, py::array::c_style | py::array::forcecast>& actuated,
                 const IntArray& point_joint, const Array& point_position,
                 const Array& point_radius, const IntArray& sphere_joint,
                 const Array& sphere_position, const Array& sphere_radius,
                 const IntArray& sphere_pairs) {
  const long n = joint_type.size(), points = point_joint.size(), spheres = sphere_joint.size();
  require_shape(joint_type, {n}, "joint_type");
  require_shape(joint_parent, {n}, "joint_parent");
  require_shape(offset, {n, 3, 4}, "joint_offset");
  require_shape(axis, {n, 3}, "joint_axis");
  require_shape(inertia, {n, 4, 4}, "link_inertia");
  Model model;
  for (long j = 0; j < n; ++j) {
    Joint joint{};
    if (joint_type.at(j) < 0 || joint_type.at(j) > 2) {
      throw ArgumentError("joint_type[" + std::to_string(j) +
                          "] = " + std::to_string(joint_type.at(j)) +
                          ": expected 0 (slide), 1 (hinge) or 2 (ball)");
    }
    joint.type = static_cast<JointType>(joint_type.at(j));
    joint.parent = joint_parent.at(j);
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) joint.offset[3 * r + c] = offset.at(j, r, c);
      joint.offset[9 + r] = offset.at(j, r, 3);
      joint.axis[r] = axis.at(j, r);
      joint.first[r] = inertia.at(j, r, 3);
    }
    constexpr int kRow[6] = {0, 0, 0, 1, 1, 2}, kColumn[6] = {0, 1, 2, 1, 2, 2};
    for (int k = 0; k < 6; ++k) joint.second[k] = inertia.at(j, kRow[k], kColumn[k]);
    joint.mass = inertia.at(j, 3, 3);
    model.joints.push_back(joint);
  }
  const auto sphere = [n](int joint, const Array& position, const Array& radius, long i,
                          const char* name) {
    if (joint < 0 || joint >= n) {
      throw ArgumentError(std::string(name) + "[" + std::to_string(i) +
                          "] = " + std::to_string(joint) + ": expected a joint index below " +
                          std::to_string(n));
    }
    return ContactPoint{
        joint, {position.at(i, 0), position.at(i, 1), position.at(i, 2)}, radius.at(i)};
  };
  require_shape(point_position, {points, 3}, "point_position");
  require_shape(point_radius, {points}, "point_radius");
  for (long i = 0; i < points; ++i)
    model.points.push_back(
        sphere(point_joint.at(i), point_position, point_radius, i, "point_joint"));
  require_shape(sphere_position, {spheres, 3}, "sphere_position");
  require_shape(sphere_radius, {spheres}, "sphere_radius");
  require_shape(sphere_pairs, {-1, 2}, "sphere_pairs");
  for (long i = 0; i < spheres; ++i)
    model.spheres.push_back(
        sphere(sphere_joint.at(i), sphere_position, sphere_radius, i, "sphere_joint"));
  for (long i = 0; i < sphere_pairs.shape(0); ++i) {
    const SpherePair pair{sphere_pairs.at(i, 0), sphere_pairs.at(i, 1)};
    for (int k : {pair.a, pair.b}) {
      if (k < 0 || k >= spheres) {
        throw ArgumentError("sphere_pairs[" + std::to_string(i) + "] = " + std::to_string(k) +
                            ": expected a sphere index below " + std::to_string(spheres));
      }
    }
    model.pairs.push_back(pair);
  }
  finalize(model);
  require_shape(lower, {model.ndof}, "lower");
  require_shape(upper, {model.ndof}, "upper");
  require_shape(actuated, {model.ndof}, "actuated");
  for (int j = 0; j < model.ndof; ++j) {
    model.lower.push_back(lower.at(j));
    model.upper.push_back(upper.at(j));
    (actuated.at(j) ? model.actuated : model.unactuated).push_back(j);
  }
  return model;
}

Integrator parse_integrator(const std::string& name) {
  static const std::pair<const char*, Integrator> kNames[] = {
      {"implicit", Integrator::implicit},
      {"verlet", Integrator::verlet},
      {"fox_goodwin", Integrator::fox_goodwin},
      {"linear_acceleration", Integrator::linear_acceleration},
      {"trapezoidal", Integrator::trapezoidal}};
  for (const auto& [text, value] : kNames)
    if (name == text) return value;
  throw ArgumentError("integrator = '" + name +
                      "': expected one of implicit, verlet, fox_goodwin, linear_acceleration, "
                      "trapezoidal");
}

Physics make_physics(const std::array<double, 3>& gravity, bool ground,
                     const std::array<double, 3>& plane_normal, double plane_offset, double normal,
                     double friction, double damping, bool coulomb, double mu, double slip_velocity,
                     double limit, double self_collision, const std::string& integrator) {
  Physics p;
  for (int k = 0; k < 3; ++k) {
    p.gravity[k] = gravity[k];
    p.plane_normal[k] = plane_normal[k];
  }
  p.ground = ground;
  p.plane_offset = plane_offset;
  p.normal = normal;
  p.friction = friction;
  p.damping = damping;
  p.coulomb = coulomb;
  p.mu = mu;
  p.slip_velocity = slip_velocity;
  p.limit = limit;
  p.self_collision = self_collision;
  p.integrator = parse_integrator(integrator);
  return p;
}

py::tuple dynamics(const Model& model, const Array& x, const Array& x1, const Array& x2,
                   const Array& dt, const Physics& physics, bool jacobians,
                   const std::optional<Array>& dt_before, int threads) {
  const long n = x.ndim() == 2 ? x.shape(0) : -1, d = model.ndof;
  require_shape(x, {n, d}, "x");
  require_shape(x1, {n, d}, "x1");
  require_shape(x2, {n, d}, "x2");
  require_shape(dt, {n}, "dt");
  if (dt_before) require_shape(*dt_before, {n}, "dt_before");
  py::array_t<double> fd = empty({n, d});
  DynamicsBatch batch{.count = n,
                      .x = x.data(),
                      .x1 = x1.data(),
                      .x2 = x2.data(),
                      .dt = dt.data(),
                      .dt_before = dt_before ? dt_before->data() : dt.data(),
                      .fd = fd.mutable_data()};
  py::array_t<double> js[3];
  if (jacobians) {
    for (int q = 0; q < 3; ++q) {
      js[q] = empty({n, d, d});
      batch.jacobians[q] = js[q].mutable_data();
    }
  }
  {
    py::gil_scoped_release release;
    dynamics_batch(model, physics, batch, threads);
  }
  if (!jacobians) return py::make_tuple(fd);
  return py::make_tuple(fd, js[0], js[1], js[2]);
}

}  // namespace

void register_model(py::module_& m) {
  using namespace py::literals;  // NOLINT(google-build-using-namespace)
  py::class_<Physics>(m, "Physics", "Force law and time scheme as plain numbers.")
      .def(py::init(&make_physics), "gravity"_a = std::array<double, 3>{0, 0, -9.81},
           "ground"_a = true, "plane_normal"_a = std::array<double, 3>{0, 0, 1},
           "plane_offset"_a = 0.0, "normal"_a = 0.0, "friction"_a = 0.0, "damping"_a = 0.0,
           "coulomb"_a = false, "mu"_a = 0.8, "slip_velocity"_a = 0.05, "limit"_a = 0.0,
           "self_collision"_a = 0.0, "integrator"_a = "linear_acceleration")
      .def_readwrite("normal", &Physics::normal)
      .def_readwrite("friction", &Physics::friction)
      .def_readwrite("damping", &Physics::damping);

  py::class_<Model, std::shared_ptr<Model>>(m, "Model", "Joint tree of a character.")
      .def(py::init([](const IntArray& joint_type, const IntArray& joint_parent,
                       const Array& joint_offset, const Array& joint_axis,
                       const Array& link_inertia, const Array& lower, const Array& upper,
                       const py::array_t<bool, py::array::c_style | py::array::forcecast>& actuated,
                       const IntArray& point_joint, const Array& point_position,
                       const Array& point_radius, const IntArray& sphere_joint,
                       const Array& sphere_position, const Array& sphere_radius,
                       const IntArray& sphere_pairs) {
             return std::make_shared<Model>(
                 make_model(joint_type, joint_parent, joint_offset, joint_axis, link_inertia, lower,
                            upper, actuated, point_joint, point_position, point_radius,
                            sphere_joint, sphere_position, sphere_radius, sphere_pairs));
           }),
           py::kw_only(), "joint_type"_a, "joint_parent"_a, "joint_offset"_a, "joint_axis"_a,
           "link_inertia"_a, "lower"_a, "upper"_a, "actuated"_a, "point_joint"_a,
           "point_position"_a, "point_radius"_a, "sphere_joint"_a, "sphere_position"_a,
           "sphere_radius"_a, "sphere_pairs"_a)
      .def_readonly("ndof", &Model::ndof)
      .def_readonly("nq", &Model::nq)
      .def_readonly("mass", &Model::mass)
      .def(
          "kinematics",
          [](const Model& model, const Array& x) {
            require_shape(x, {-1, model.ndof}, "x");
            const long n = x.shape(0);
            auto out = empty({n, static_cast<long>(model.joints.size()), 3, 4});
            kinematics_batch(model, n, x.data(), out.mutable_data());
            return out;
          },
          "x"_a)
      .def(
          "center_of_mass",
          [](const Model& model, const Array& x) {
            require_shape(x, {-1, model.ndof}, "x");
            auto out = empty({x.shape(0), 3});
            center_of_mass_batch(model, x.shape(0), x.data(), out.mutable_data());
            return out;
          },
          "x"_a)
      .def(
          "residual",
          [](const Model& model, const Array& x, const Array& x1, const Array& x2, const Array& dt,
             const Physics& physics, const std::optional<Array>& dt_before,
             int threads) -> py::object {
            return dynamics(model, x, x1, x2, dt, physics, false, dt_before, threads)[0];
          },
          "x"_a, "x1"_a, "x2"_a, "dt"_a, "physics"_a, "dt_before"_a = py::none(), "threads"_a = 1)
      .def(
          "jacobians",
          [](const Model& model, const Array& x, const Array& x1, const Array& x2, const Array& dt,
             const Physics& physics, const std::optional<Array>& dt_before, int threads) {
            return dynamics(model, x, x1, x2, dt, physics, true, dt_before, threads);
          },
          "x"_a, "x1"_a, "x2"_a, "dt"_a, "physics"_a, "dt_before"_a = py::none(), "threads"_a = 1)
      .def(
          "contact_forces",
          [](const Model& model, const Array& x, const Array& velocity, const Physics& physics) {
            const long n = x.ndim() == 2 ? x.shape(0) : -1;
            const long p = static_cast<long>(model.points.size());
            require_shape(x, {n, model.ndof}, "x");
            require_shape(velocity, {n, p, 3}, "velocity");
            auto out = empty({n, p, 3});
            contact_forces_batch(model, physics, n, x.data(), velocity.data(), out.mutable_data());
            return out;
          },
          "x"_a, "velocity"_a, "physics"_a);
}

}  // namespace trajopt::bindings
