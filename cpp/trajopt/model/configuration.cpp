#include "trajopt/model/configuration.h"

#include "trajopt/model/integrate.h"

namespace trajopt {

void configuration_from_vector(const Model& model, const double* x, double* q) {
  for (const Joint& joint : model.joints) {
    if (joint.type == JointType::ball) {
      quaternion_exp({x[joint.dof], x[joint.dof + 1], x[joint.dof + 2]}, q + joint.q);
    } else {
      q[joint.q] = x[joint.dof];
    }
  }
}

void configuration_to_vector(const Model& model, const double* q, double* x) {
  for (const Joint& joint : model.joints) {
    if (joint.type == JointType::ball) {
      const Vec3<double> r = quaternion_log(q + joint.q);
      for (int k = 0; k < 3; ++k) x[joint.dof + k] = r[k];
    } else {
      x[joint.dof] = q[joint.q];
    }
  }
}

void integrate(const Model& model, const double* q, const double* step, double* out) {
  for (const Joint& joint : model.joints) integrate_joint(joint, q, step, out);
}

void difference(const Model& model, const double* a, const double* b, double* step) {
  for (const Joint& joint : model.joints) {
    if (joint.type == JointType::ball) {
      const Vec3<double> r = quaternion_difference(a + joint.q, b + joint.q);
      for (int k = 0; k < 3; ++k) step[joint.dof + k] = r[k];
    } else {
      step[joint.dof] = a[joint.q] - b[joint.q];
    }
  }
}

}  // namespace trajopt
