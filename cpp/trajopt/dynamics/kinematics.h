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

// Where the joint stands before it moves.
template <class S>
TRAJOPT_HD inline Transform<S> joint_anchor(const Joint& joint, const Transform<S>* joints) {
  Transform<S> t;
  t.translation = broadcast3<S>(joint.offset + 9);
  if (joint.parent < 0) {
    t.rotation = constant_rotation<S>(joint.offset);
    return t;
  }
  const Transform<S>& parent = joints[joint.parent];
  t.translation = apply(parent, t.translation);
  t.rotation = joint.plain ? parent.rotation : parent.rotation * constant_rotation<S>(joint.offset);
  return t;
}

// r := r times the rotation about the K-th axis with sine s and cosine c: turns two columns.
template <int K, class S>
TRAJOPT_HD inline void turn_about(Mat3<S>& r, const S& s, const S& c) {
  constexpr int I = (K + 1) % 3, J = (K + 2) % 3;
  for (int k = 0; k < 3; ++k) {
    const S i = r(k, I), j = r(k, J);
    r(k, I) = fma(c, i, s * j);
    r(k, J) = fma(c, j, -(s * i));
  }
}

// Always inlined: t stays in registers.
template <class S>
__attribute__((always_inline)) TRAJOPT_HD inline void move_hinge(const Joint& joint, const S& angle,
                                                                 Transform<S>& t, Twist<S>& twist) {
  S s, c;
  sincos(angle, s, c);
  switch (joint.aligned) {
    case 0:
      twist.w = t.rotation.column(0);
      turn_about<0>(t.rotation, s, c);
      break;
    case 1:
      twist.w = t.rotation.column(1);
      turn_about<1>(t.rotation, s, c);
      break;
    case 2:
      twist.w = t.rotation.column(2);
      turn_about<2>(t.rotation, s, c);
      break;
    default:
      twist.w = t.rotation * broadcast3<S>(joint.axis);
      t.rotation = t.rotation * axis_rotation(joint.axis, s, c);
  }
  twist.v = cross(t.translation, twist.w);
}

template <class S, Chart C>
TRAJOPT_HD inline void move_ball(const S* q, Transform<S>& t, Twist<S>* twist) {
  const Mat3<S> before = t.rotation;
  Mat3<S> directions = before;
  if constexpr (C == Chart::vector) {
    const Vec3<S> r{q[0], q[1], q[2]};
    S quaternion[4];
    quaternion_exp(r, quaternion);
    t.rotation = before * quaternion_matrix(quaternion);
    directions = before * left_jacobian(r);
  } else {
    t.rotation = before * quaternion_matrix(q);
  }
  for (int k = 0; k < 3; ++k) {
    twist[k].w = directions.column(k);
    twist[k].v = cross(t.translation, twist[k].w);
  }
}

// q: nq entries for Chart::tangent, ndof entries (rotation vectors) for Chart::vector.
template <class S, Chart C>
TRAJOPT_HD inline void forward_kinematics(const ModelView& model, const S* q, Transform<S>* joints,
                                          Twist<S>* twists) {
  for (int j = 0; j < model.njoint; ++j) {
    const Joint& joint = model.joints[j];
    Transform<S> t = joint_anchor(joint, joints);
    const S* qj = q + (C == Chart::vector ? joint.dof : joint.q);
    Twist<S>* twist = twists + joint.dof;
    if (joint.type == JointType::ball) {
      move_ball<S, C>(qj, t, twist);
    } else if (joint.type == JointType::hinge) {
      move_hinge(joint, qj[0], t, *twist);
    } else {
      const Vec3<S> axis = t.rotation * broadcast3<S>(joint.axis);
      *twist = {{S(0.0), S(0.0), S(0.0)}, axis};
      t.translation = fma(qj[0], axis, t.translation);
    }
    joints[j] = t;
  }
}

}  // namespace trajopt::inline TRAJOPT_ISA
