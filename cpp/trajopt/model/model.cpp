#include "trajopt/model/model.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "trajopt/base/error.h"

namespace trajopt {

namespace {

// A ball around the spheres of a joint.
ContactPoint hull_of(const Model& model, int joint) {
  ContactPoint hull{joint, {0, 0, 0}, 0};
  for (int k = 0; k < 3; ++k) {
    double low = HUGE_VAL, high = -HUGE_VAL;
    for (const ContactPoint& s : model.spheres) {
      if (s.joint != joint) continue;
      low = std::min(low, s.position[k] - s.radius);
      high = std::max(high, s.position[k] + s.radius);
    }
    hull.position[k] = 0.5 * (low + high);
  }
  for (const ContactPoint& s : model.spheres) {
    if (s.joint != joint) continue;
    const double distance =
        std::hypot(s.position[0] - hull.position[0], s.position[1] - hull.position[1],
                   s.position[2] - hull.position[2]);
    hull.radius = std::max(hull.radius, distance + s.radius);
  }
  return hull;
}

void group_pairs(Model& model) {
  // Far more than rounding moves a sphere against its hull, so that leaving out a run never shows.
  constexpr double kMargin = 1e-3;
  model.hulls.clear();
  model.runs.clear();
  std::vector<int> hull(model.joints.size(), -1);
  for (int k = 0; k < static_cast<int>(model.pairs.size()); ++k) {
    const SpherePair& pair = model.pairs[k];
    const int joint = model.spheres[pair.b].joint;
    if (hull[joint] < 0) {
      hull[joint] = static_cast<int>(model.hulls.size());
      model.hulls.push_back(hull_of(model, joint));
    }
    const double reach = model.spheres[pair.a].radius + model.hulls[hull[joint]].radius;
    if (model.runs.empty() || model.runs.back().a != pair.a ||
        model.runs.back().hull != hull[joint]) {
      model.runs.push_back({k, k, pair.a, hull[joint], (1 + kMargin) * reach});
    }
    model.runs.back().end = k + 1;
  }
}

}  // namespace

void finalize(Model& model) {
  model.ndof = model.nq = 0;
  model.mass = 0;
  model.dof_joint.clear();
  model.dof_parent.clear();
  const int count = static_cast<int>(model.joints.size());
  for (int j = 0; j < count; ++j) {
    Joint& joint = model.joints[j];
    if (joint.parent < -1 || joint.parent >= j) {
      throw ArgumentError("joint_parent[" + std::to_string(j) +
                          "] = " + std::to_string(joint.parent) +
                          ": expected -1 (the world) or the index of an earlier joint");
    }
    joint.dof = model.ndof;
    joint.q = model.nq;
    joint.subtree_mass = joint.mass;
    joint.massless = joint.mass == 0;
    for (double e : joint.first) joint.massless &= e == 0;
    for (double e : joint.second) joint.massless &= e == 0;
    joint.plain = true;
    for (int k = 0; k < 9; ++k) joint.plain &= joint.offset[k] == (k % 4 == 0 ? 1.0 : 0.0);
    joint.aligned = -1;
    for (int k = 0; k < 3; ++k)
      if (joint.axis[k] == 1 && joint.axis[(k + 1) % 3] == 0 && joint.axis[(k + 2) % 3] == 0)
        joint.aligned = k;
    model.ndof += joint.ndof();
    model.nq += joint.nq();
    model.mass += joint.mass;
    for (int k = 0; k < joint.ndof(); ++k) {
      int parent = -1;
      if (k > 0) {
        parent = joint.dof + k - 1;
      } else if (joint.parent >= 0) {
        const Joint& above = model.joints[joint.parent];
        parent = above.dof + above.ndof() - 1;
      }
      model.dof_joint.push_back(j);
      model.dof_parent.push_back(parent);
    }
  }
  for (int j = count - 1; j >= 0; --j) {
    const Joint& joint = model.joints[j];
    if (joint.parent >= 0) model.joints[joint.parent].subtree_mass += joint.subtree_mass;
  }
  group_pairs(model);
}

ModelView view(const Model& m) {
  return {.ndof = m.ndof,
          .nq = m.nq,
          .njoint = static_cast<int>(m.joints.size()),
          .nactuated = static_cast<int>(m.actuated.size()),
          .nunactuated = static_cast<int>(m.unactuated.size()),
          .npoint = static_cast<int>(m.points.size()),
          .nsphere = static_cast<int>(m.spheres.size()),
          .npair = static_cast<int>(m.pairs.size()),
          .nhull = static_cast<int>(m.hulls.size()),
          .nrun = static_cast<int>(m.runs.size()),
          .mass = m.mass,
          .joints = m.joints.data(),
          .dof_joint = m.dof_joint.data(),
          .dof_parent = m.dof_parent.data(),
          .lower = m.lower.data(),
          .upper = m.upper.data(),
          .actuated = m.actuated.data(),
          .unactuated = m.unactuated.data(),
          .points = m.points.data(),
          .spheres = m.spheres.data(),
          .pairs = m.pairs.data(),
          .hulls = m.hulls.data(),
          .runs = m.runs.data()};
}

}  // namespace trajopt
