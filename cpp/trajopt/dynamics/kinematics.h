// Forward kinematics of one frame: joint transforms and, per degree of freedom, its world twist.
//
// Twist (w, v) of dof j: every point P that j moves has dP/dx_j = w x P + v.
// Chart::tangent: rotations are perturbed on the left, R <- exp(delta) R (the optimizer's chart);
// Chart::vector: x holds rotation vectors and the twist carries J_l(r) (the chart users see).
#pragma once

#include "trajopt/base/vec3.h"
#include "trajopt/model/model.h"
#include "trajopt/model/rotation.h"

namespace trajopt::inline TRAJOPT_ISA {

enum class Chart { tangent, vector };

template <class S>
struct Twist {
  Vec3<S> w, v;
};

template <class S>
TRAJOPT_HD inline S dot(const Twist<S>& a, const Twist<S>& b) {
  return fma(a.w.z, b.w.z, fma(a.w.y, b.w.y, fma(a.w.x, b.w.x, dot(a.v, b.v))));
}

// dP/dx_j for a point the dof moves.
template <class S>
TRAJOPT_HD inline Vec3<S> point_velocity(const Twist<S>& twist, const Vec3<S>& point) {
  return cross(twist.w, point) + twist.v;
}

template <class S>
TRAJOPT_HD inline Mat3<S> constant_rotation(const double* m) {
  Mat3<S> r;
  for (int i = 0; i < 9; ++i) r.m[i] = S(m[i]);
  return r;
}

// q: nq entries for Chart::tangent, ndof entries (rotation vectors) for Chart::vector.
template <class S, Chart C>
TRAJOPT_HD inline void forward_kinematics(const ModelView& model, const S* q, Transform<S>* joints,
                                          Twist<S>* twists) {
  for (int j = 0; j < model.njoint; ++j) {
    const Joint& joint = model.joints[j];
    Transform<S> t;
    t.rotation = constant_rotation<S>(joint.offset);
    t.translation = broadcast3<S>(joint.offset + 9);
    if (joint.parent >= 0) {
      const Transform<S>& parent = joints[joint.parent];
      t.translation = apply(parent, t.translation);
      t.rotation = parent.rotation * t.rotation;
    }
    const S* qj = q + (C == Chart::vector ? joint.dof : joint.q);
    Twist<S>* twist = twists + joint.dof;
    if (joint.type == JointType::ball) {
      const Mat3<S> before = t.rotation;
      Mat3<S> directions = before;
      if constexpr (C == Chart::vector) {
        const Vec3<S> r{qj[0], qj[1], qj[2]};
        S quaternion[4];
        quaternion_exp(r, quaternion);
        t.rotation = before * quaternion_matrix(quaternion);
        directions = before * left_jacobian(r);
      } else {
        t.rotation = before * quaternion_matrix(qj);
      }
      for (int k = 0; k < 3; ++k) {
        twist[k].w = directions.column(k);
        twist[k].v = cross(t.translation, twist[k].w);
      }
    } else {
      const Vec3<S> axis = t.rotation * broadcast3<S>(joint.axis);
      if (joint.type == JointType::hinge) {
        twist->w = axis;
        twist->v = cross(t.translation, axis);
        t.rotation = t.rotation * axis_rotation(joint.axis, qj[0]);
      } else {
        twist->w = {S(0.0), S(0.0), S(0.0)};
        twist->v = axis;
        t.translation = fma(qj[0], axis, t.translation);
      }
    }
    joints[j] = t;
  }
}

}  // namespace trajopt::inline TRAJOPT_ISA
