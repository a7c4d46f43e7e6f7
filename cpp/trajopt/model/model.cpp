#include "trajopt/model/model.h"

#include <string>

#include "trajopt/base/error.h"

namespace trajopt {

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
          .pairs = m.pairs.data()};
}

}  // namespace trajopt
