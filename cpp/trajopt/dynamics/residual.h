// Position-based dynamics: the residual FD of Pan eq. 5 (and of the centred family) over the nodes
// x_i, x_{i-1}, x_{i-2}, and its three Jacobians, by three sweeps over the tree.
//
//   1 outward   joint transforms T and twists xi at the three nodes        (kinematics.h)
//   2 inward    composites: second[q] = sum P_q P_a^T, contact wrenches, contact stiffness
//   3 pairs     for dof j and its ancestors l:
//                 FD_j      = xi_j . wrench_j
//                 dFD_j/dq_l = xi_j^T B_q xi_l(q)   (composite B of the more distal dof)
//                            + geometric term w_l . h_j at the node that tests
//
// With P_q P_a^T summed to S3, m c_q = s_q, the inertial 6x6 composite is
//   K_q = [[tr(S3) I - S3, [s_a]x], [-[s_q]x, m I]].
#pragma once

#include "trajopt/dynamics/workspace.h"
#include "trajopt/force/contact.h"
#include "trajopt/force/internal.h"

namespace trajopt::inline TRAJOPT_ISA {

template <class S>
struct StencilPack {  // Stencil, one per lane
  S acceleration[3], contact[3], velocity[3][3];
};

// ---- sweep 2
// -------------------------------------------------------------------------------------

template <class S>
TRAJOPT_HD inline void link_composite(const Joint& joint, const DynamicsWorkspace<S>& ws, int index,
                                      int a, Composite<S>& c) {
  const S mass = S(joint.mass);
  const Vec3<S> first = broadcast3<S>(joint.first);
  for (int q = 0; q < 3; ++q) {
    const Transform<S>& t = ws.joints[q][index];
    c.first[q] = fma(mass, t.translation, t.rotation * first);
  }
  // X = sum p P_a^T = second R_a^T + first t_a^T;  sum P_q P_a^T = R_q X + t_q first_a^T.
  const double* s = joint.second;
  const Mat3<S> second{
      {S(s[0]), S(s[1]), S(s[2]), S(s[1]), S(s[3]), S(s[4]), S(s[2]), S(s[4]), S(s[5])}};
  const Transform<S>& ta = ws.joints[a][index];
  Mat3<S> x;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      x(i, j) = fma(first[i], ta.translation[j],
                    fma(second(i, 2), ta.rotation(j, 2),
                        fma(second(i, 1), ta.rotation(j, 1), second(i, 0) * ta.rotation(j, 0))));
  for (int q = 0; q < 3; ++q) {
    c.second[q] = ws.joints[q][index].rotation * x;
    add_outer(c.second[q], S(1.0), ws.joints[q][index].translation, c.first[a]);
  }
}

// k += scale * W(P)^T A W(R), W(P) = [-[P]x, I].
template <class S>
TRAJOPT_HD inline void add_point_stiffness(Stiffness<S>& k, const Mat3<S>& a, const Vec3<S>& p,
                                           const Vec3<S>& r) {
  Mat3<S> pa;  // [P]x A
  for (int j = 0; j < 3; ++j) {
    const Vec3<S> column = cross(p, a.column(j));
    for (int i = 0; i < 3; ++i) pa(i, j) = column[i];
  }
  for (int i = 0; i < 3; ++i) {
    // row . (-[R]x) = R x row, row by row
    const Vec3<S> vw = cross(r, Vec3<S>{a(i, 0), a(i, 1), a(i, 2)});
    const Vec3<S> ww = cross(r, Vec3<S>{pa(i, 0), pa(i, 1), pa(i, 2)});
    for (int j = 0; j < 3; ++j) {
      k.ww(i, j) += ww[j];
      k.wv(i, j) += pa(i, j);
      k.vw(i, j) += vw[j];
      k.vv(i, j) += a(i, j);
    }
  }
}

// Contact forces at every node that has weight; returns true when any lane touches anything.
template <class S, bool Derivatives>
TRAJOPT_HD inline void add_contacts(const ModelView& model, const Physics& physics,
                                    const StencilPack<S>& stencil, DynamicsWorkspace<S>& ws) {
  for (int c = 0; c < model.npoint; ++c) {
    const ContactPoint& point = model.points[c];
    const Vec3<S> local = broadcast3<S>(point.position);
    Vec3<S> p[3];
    for (int q = 0; q < 3; ++q) p[q] = apply(ws.joints[q][point.joint], local);
    for (int t = 0; t < 3; ++t) {
      const S depth = ground_depth(physics, p[t], point.radius);
      if (!any(depth > S(0.0)) || !any(stencil.contact[t] > S(0.0))) continue;
      Vec3<S> velocity = stencil.velocity[t][0] * p[0];
      velocity = fma(stencil.velocity[t][1], p[1], velocity);
      velocity = fma(stencil.velocity[t][2], p[2], velocity);
      ContactForce<S> contact;
      contact_force<S, Derivatives>(physics, depth, velocity, contact);
      const S weight = -stencil.contact[t];
      Wrench<S>& wrench = ws.wrenches[t][point.joint];
      wrench.force = fma(weight, contact.force, wrench.force);
      add_outer(wrench.moment, weight, contact.force, p[t]);
      ws.touched[t][point.joint] = 1;
      if constexpr (Derivatives) {
        for (int q = 0; q < 3; ++q) {
          Mat3<S> a;
          for (int i = 0; i < 9; ++i) {
            a.m[i] = stencil.velocity[t][q] * contact.by_velocity.m[i];
            if (q == t) a.m[i] += contact.by_position.m[i];
            a.m[i] *= weight;
          }
          add_point_stiffness(ws.stiffness[9 * point.joint + 3 * t + q], a, p[t], p[q]);
        }
      }
    }
  }
}

template <class S>
TRAJOPT_HD inline void clear(Wrench<S>& w) {
  for (S& e : w.moment.m) e = S(0.0);
  w.force = {S(0.0), S(0.0), S(0.0)};
}

template <class S>
TRAJOPT_HD inline void clear(Stiffness<S>& k) {
  for (int i = 0; i < 9; ++i) k.ww.m[i] = k.wv.m[i] = k.vw.m[i] = k.vv.m[i] = S(0.0);
}

template <class S, bool Derivatives>
TRAJOPT_HD inline void inward_sweep(const ModelView& model, const Physics& physics,
                                    const StencilPack<S>& stencil, int a,
                                    DynamicsWorkspace<S>& ws) {
  for (int j = 0; j < model.njoint; ++j) {
    link_composite(model.joints[j], ws, j, a, ws.composites[j]);
    for (int t = 0; t < 3; ++t) {
      ws.touched[t][j] = 0;
      clear(ws.wrenches[t][j]);
    }
    if constexpr (Derivatives) {
      for (int k = 0; k < 9; ++k) clear(ws.stiffness[9 * j + k]);
    }
  }
  if (physics.contact()) add_contacts<S, Derivatives>(model, physics, stencil, ws);
  if (physics.self_collision > 0) add_self_collision_wrenches(model, physics, a, ws);
  for (int j = model.njoint - 1; j >= 0; --j) {
    const int parent = model.joints[j].parent;
    if (parent < 0) continue;
    for (int q = 0; q < 3; ++q) {
      ws.composites[parent].second[q] += ws.composites[j].second[q];
      ws.composites[parent].first[q] += ws.composites[j].first[q];
    }
    for (int t = 0; t < 3; ++t) {
      if (!ws.touched[t][j]) continue;
      ws.touched[t][parent] = 1;
      ws.wrenches[t][parent].moment += ws.wrenches[t][j].moment;
      ws.wrenches[t][parent].force += ws.wrenches[t][j].force;
      if constexpr (Derivatives) {
        for (int q = 0; q < 3; ++q) {
          Stiffness<S>& up = ws.stiffness[9 * parent + 3 * t + q];
          const Stiffness<S>& own = ws.stiffness[9 * j + 3 * t + q];
          up.ww += own.ww;
          up.wv += own.wv;
          up.vw += own.vw;
          up.vv += own.vv;
        }
      }
    }
  }
}

// ---- sweep 3
// -------------------------------------------------------------------------------------

// Total wrench of joint j's subtree at test node t: inertia and gravity (at node a) plus forces.
template <class S>
TRAJOPT_HD inline Wrench<S> total_wrench(const ModelView& model, const Physics& physics,
                                         const StencilPack<S>& stencil, int a, int t, int j,
                                         const DynamicsWorkspace<S>& ws) {
  Wrench<S> w = ws.wrenches[t][j];
  if (t != a) return w;
  const Composite<S>& c = ws.composites[j];
  for (int q = 0; q < 3; ++q) {
    for (int i = 0; i < 9; ++i)
      w.moment.m[i] = fma(stencil.acceleration[q], c.second[q].m[i], w.moment.m[i]);
    w.force = fma(stencil.acceleration[q], c.first[q], w.force);
  }
  const Vec3<S> g = broadcast3<S>(physics.gravity);
  add_outer(w.moment, S(-1.0), g, c.first[a]);
  w.force = fma(S(-model.joints[j].subtree_mass), g, w.force);
  return w;
}

template <class S>
TRAJOPT_HD inline Vec3<S> axial(const Mat3<S>& q) {
  return {q(2, 1) - q(1, 2), q(0, 2) - q(2, 0), q(1, 0) - q(0, 1)};
}

// h with <[xi_l][xi_j], Q> = w_l . h for every ancestor l of j.
template <class S>
TRAJOPT_HD inline Vec3<S> geometric_term(const Wrench<S>& q, const Twist<S>& j) {
  const S trace = q.moment(0, 0) + q.moment(1, 1) + q.moment(2, 2);
  return fma(-trace, j.w, transposed_times(q.moment, j.w)) + cross(j.v, q.force);
}

// scale * K_q^T xi (transposed) or scale * K_q xi.
template <class S>
TRAJOPT_HD inline Twist<S> inertia_times(const Composite<S>& c, double mass, int a, int q,
                                         bool transposed, const S& scale, const Twist<S>& xi) {
  const Mat3<S>& s3 = c.second[q];
  const S trace = s3(0, 0) + s3(1, 1) + s3(2, 2);
  const Vec3<S> rotated = transposed ? transposed_times(s3, xi.w) : s3 * xi.w;
  const Vec3<S>& s_out = c.first[transposed ? q : a];
  const Vec3<S>& s_in = c.first[transposed ? a : q];
  Twist<S> y;
  y.w = scale * (fma(trace, xi.w, cross(s_out, xi.v)) - rotated);
  y.v = scale * fma(S(mass), xi.v, cross(xi.w, s_in));
  return y;
}

template <class S>
TRAJOPT_HD inline void add_stiffness_times(const Stiffness<S>& k, bool transposed,
                                           const Twist<S>& xi, Twist<S>& y) {
  if (transposed) {
    y.w += transposed_times(k.ww, xi.w) + transposed_times(k.vw, xi.v);
    y.v += transposed_times(k.wv, xi.w) + transposed_times(k.vv, xi.v);
  } else {
    y.w += k.ww * xi.w + k.wv * xi.v;
    y.v += k.vw * xi.w + k.vv * xi.v;
  }
}

// Derivative dw of the direction tested by dof `row` of a ball with respect to dof `col` of the
// same ball, beyond what geometric_term (ancestor outermost) already holds.
template <class S, Chart C>
TRAJOPT_HD inline Vec3<S> ball_direction_derivative(const Joint& joint, const S* q,
                                                    const Transform<S>* joints, const Twist<S>* xi,
                                                    int row, int col) {
  const int high = row > col ? row : col, low = row > col ? col : row;
  if constexpr (C == Chart::tangent) {  // directions fixed in the frame before the rotation
    if (row > col) return cross(xi[joint.dof + row].w, xi[joint.dof + col].w);
    return {S(0.0), S(0.0), S(0.0)};
  } else {
    const Vec3<S> r{q[joint.dof], q[joint.dof + 1], q[joint.dof + 2]};
    const ExpCoefficients k = exp_coefficients(dot(r, r));
    Vec3<S> el{low == 0 ? 1.0 : 0.0, low == 1 ? 1.0 : 0.0, low == 2 ? 1.0 : 0.0};
    Vec3<S> eq{high == 0 ? 1.0 : 0.0, high == 1 ? 1.0 : 0.0, high == 2 ? 1.0 : 0.0};
    Vec3<S> d = (k.da * r[high]) * el + k.b * cross(eq, el) + (k.db * r[high]) * cross(r, el) +
                k.c * (r[low] * eq) + (k.dc * r[high] * r[low]) * r;
    if (low == high) d += k.c * r;
    Mat3<S> before = constant_rotation<S>(joint.offset);
    if (joint.parent >= 0) before = joints[joint.parent].rotation * before;
    return before * d;
  }
}

// FD (D) and, with Derivatives, J[q] = dFD/dx(node q), each D x D row-major.
// nodes[q]: configuration of frame i - q, laid out as forward_kinematics expects.
template <class S, Chart C, bool Derivatives>
TRAJOPT_HD inline void dynamics_residual(const ModelView& model, const Physics& physics,
                                         const StencilPack<S>& stencil, const S* const nodes[3],
                                         DynamicsWorkspace<S>& ws, S* fd, S* const jacobians[3]) {
  const int a = physics.integrator == Integrator::implicit ? 0 : 1;
  const int d = model.ndof;
  for (int q = 0; q < 3; ++q) forward_kinematics<S, C>(model, nodes[q], ws.joints[q], ws.twists[q]);
  inward_sweep<S, Derivatives>(model, physics, stencil, a, ws);
  if constexpr (Derivatives) {
    for (int q = 0; q < 3; ++q)
      for (int i = 0; i < d * d; ++i) jacobians[q][i] = S(0.0);
  }

  for (int j = 0; j < d; ++j) {
    const int joint_index = model.dof_joint[j];
    const Joint& joint = model.joints[joint_index];
    const Composite<S>& composite = ws.composites[joint_index];
    Twist<S> y[3], z[3][3];  // y[q]: row j; z[t][q]: column j, to be tested with node t's twists
    bool tested[3];
    S residual = S(0.0);
    Wrench<S> wrench[3];
    for (int t = 0; t < 3; ++t) {
      tested[t] = t == a || ws.touched[t][joint_index];
      if (!tested[t]) continue;
      wrench[t] = total_wrench(model, physics, stencil, a, t, joint_index, ws);
      const Twist<S>& xi = ws.twists[t][j];
      residual += dot(xi.w, axial(wrench[t].moment)) + dot(xi.v, wrench[t].force);
    }
    fd[j] = residual;
    if constexpr (!Derivatives) continue;

    for (int q = 0; q < 3; ++q) {
      y[q] = inertia_times(composite, joint.subtree_mass, a, q, true, stencil.acceleration[q],
                           ws.twists[a][j]);
      z[a][q] = inertia_times(composite, joint.subtree_mass, a, q, false, stencil.acceleration[q],
                              ws.twists[q][j]);
    }
    for (int t = 0; t < 3; ++t) {
      if (!tested[t]) continue;
      if (ws.touched[t][joint_index]) {
        for (int q = 0; q < 3; ++q) {
          const Stiffness<S>& k = ws.stiffness[9 * joint_index + 3 * t + q];
          add_stiffness_times(k, true, ws.twists[t][j], y[q]);
          if (t != a) z[t][q] = {{S(0.0), S(0.0), S(0.0)}, {S(0.0), S(0.0), S(0.0)}};
          add_stiffness_times(k, false, ws.twists[q][j], z[t][q]);
        }
      }
      const Vec3<S> h = geometric_term(wrench[t], ws.twists[t][j]);
      y[t].w += h;
      z[t][t].w += h;
    }
    for (int l = j; l >= 0; l = model.dof_parent[l]) {
      for (int q = 0; q < 3; ++q) {
        S* jq = jacobians[q];
        jq[j * d + l] = dot(y[q], ws.twists[q][l]);
        if (l == j) continue;
        S sum = dot(z[a][q], ws.twists[a][l]);
        for (int t = 0; t < 3; ++t)
          if (t != a && tested[t]) sum += dot(z[t][q], ws.twists[t][l]);
        jq[l * d + j] = sum;
      }
    }
    if (joint.type == JointType::ball) {
      for (int t = 0; t < 3; ++t) {
        if (!tested[t]) continue;
        const Vec3<S> n = axial(wrench[t].moment);
        const Vec3<S>& origin = ws.joints[t][joint_index].translation;
        const auto torque = [&](int row, int col) {
          const Vec3<S> dw = ball_direction_derivative<S, C>(joint, nodes[t], ws.joints[t],
                                                             ws.twists[t], row, col);
          return dot(dw, n) + dot(cross(origin, dw), wrench[t].force);
        };
        const int k = j - joint.dof;
        for (int m = 0; m <= k; ++m) {
          S* row_j = jacobians[t] + j * d + joint.dof + m;
          *row_j += torque(k, m);
          if (m != k) jacobians[t][(joint.dof + m) * d + j] += torque(m, k);
        }
      }
    }
  }

  add_joint_limits<S, C, Derivatives>(model, physics, nodes[a], fd,
                                      Derivatives ? jacobians[a] : nullptr);
  if constexpr (Derivatives) {
    if (physics.self_collision > 0) {
      add_self_collision_stiffness(model, physics, a, ws, jacobians[a]);
    }
  }
}

}  // namespace trajopt::inline TRAJOPT_ISA
