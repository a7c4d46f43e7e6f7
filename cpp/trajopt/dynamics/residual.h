// Position-based dynamics: the residual FD of Pan eq. 5 (and of the centred family) over the nodes
// x_i, x_{i-1}, x_{i-2}, and its three Jacobians, by three sweeps over the tree.
//
//   1 outward   joint transforms T and twists xi at the three nodes        (kinematics.h)
//   2 inward    sums over subtrees: sum P_q P_a^T, wrenches                 (composites.h)
//   3 pairs     for dof j and its ancestors l, while sweep 2 stands at j:
//                 FD_j      = xi_j . wrench_j
//                 dFD_j/dq_l = xi_j^T K_q xi_l(q), dFD_l/dq_j = xi_l^T K_q xi_j(q)
//                            + geometric term w_l . h_j at the node that tests
//
// With P_q P_a^T summed to S3, m c_q = s_q, the inertial 6x6 composite is
//   K_q = [[tr(S3) I - S3, [s_a]x], [-[s_q]x, m I]],
// symmetric at the inertia node a. Contacts come point by point (contacts.h).
#pragma once

#include "trajopt/dynamics/contacts.h"
#include "trajopt/force/internal.h"

namespace trajopt::inline TRAJOPT_ISA {

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

// tr(S3) I - S3
template <class S>
TRAJOPT_HD inline Mat3<S> turning(const Mat3<S>& second) {
  Mat3<S> r;
  for (int i = 0; i < 9; ++i) r.m[i] = -second.m[i];
  const S trace = second(0, 0) + second(1, 1) + second(2, 2);
  for (int i = 0; i < 3; ++i) r(i, i) += trace;
  return r;
}

// What the dofs of one joint carry, and the pairs they make with their ancestors.
template <class S>
struct Carried {
  S mass;
  const Mat3<S>* second;
  const Vec3<S>* first;
  const Wrench<S>* wrench[3];  // null: nothing is felt at this node

  // scale * K_q^T xi
  TRAJOPT_HD Twist<S> row(int a, int q, const S& scale, const Twist<S>& xi) const {
    return {scale * (transposed_times(turning(second[q]), xi.w) + cross(first[q], xi.v)),
            scale * fma(mass, xi.v, cross(xi.w, first[a]))};
  }
  // scale * K_q xi
  TRAJOPT_HD Twist<S> column(int a, int q, const S& scale, const Twist<S>& xi) const {
    return {scale * (turning(second[q]) * xi.w + cross(first[a], xi.v)),
            scale * fma(mass, xi.v, cross(xi.w, first[q]))};
  }
};

template <class S>
TRAJOPT_HD inline void add_pairs(const ModelView& model, const StencilPack<S>& stencil, int a,
                                 int j, const Carried<S>& carried, const DynamicsWorkspace<S>& ws,
                                 S* const jacobians[3]) {
  const int d = model.ndof;
  const Twist<S>& xa = ws.twists[a][j];
  Vec3<S> h[3];
  for (int t = 0; t < 3; ++t)
    if (carried.wrench[t] != nullptr) h[t] = geometric_term(*carried.wrench[t], ws.twists[t][j]);
  for (int q = 0; q < 3; ++q) {  // row j
    if (q == a) continue;
    Twist<S> y = carried.row(a, q, stencil.acceleration[q], xa);
    S *row = jacobians[q] + j * d, *column = jacobians[q] + j;
    if (carried.wrench[q] == nullptr) {
      for (int l = j; l >= 0; l = model.dof_parent[l]) row[l] += dot(y, ws.twists[q][l]);
      continue;
    }
    y.w += h[q];
    row[j] += dot(y, ws.twists[q][j]);
    for (int l = model.dof_parent[j]; l >= 0; l = model.dof_parent[l]) {
      const Twist<S> xi = ws.twists[q][l];
      row[l] += dot(y, xi);
      column[l * d] += dot(h[q], xi.w);
    }
  }
  // Column j, and at the inertia node both: K_a and the geometric term are symmetric.
  const int b = a == 0 ? 1 : 0, c = 2;  // the other two nodes
  Twist<S> y = carried.row(a, a, stencil.acceleration[a], xa);
  y.w += h[a];
  const Twist<S> zb = carried.column(a, b, stencil.acceleration[b], ws.twists[b][j]);
  const Twist<S> zc = carried.column(a, c, stencil.acceleration[c], ws.twists[c][j]);
  S *ja = jacobians[a], *jb = jacobians[b], *jc = jacobians[c];
  ja[j * d + j] += dot(y, xa);
  for (int l = model.dof_parent[j]; l >= 0; l = model.dof_parent[l]) {
    const Twist<S> xi = ws.twists[a][l];
    const S both = dot(y, xi);
    ja[j * d + l] += both;
    ja[l * d + j] += both;
    jb[l * d + j] += dot(zb, xi);
    jc[l * d + j] += dot(zc, xi);
  }
}

// Derivatives dw of the directions tested by the dofs of one ball with respect to the dofs of the
// same ball, beyond what geometric_term (ancestor outermost) already holds, at one node.
template <class S, Chart C>
struct BallDirections;

template <class S>
struct BallDirections<S, Chart::tangent> {  // directions fixed in the frame before the rotation
  const Twist<S>* xi;

  TRAJOPT_HD BallDirections(const Joint& joint, const S*, const Transform<S>*,
                            const Twist<S>* twists)
      : xi(twists + joint.dof) {}
  TRAJOPT_HD static int columns(int row) { return row; }  // nothing is left for row <= column
  TRAJOPT_HD Vec3<S> derivative(int row, int column) const {
    return cross(xi[row].w, xi[column].w);
  }
};

template <class S>
struct BallDirections<S, Chart::vector> {
  Vec3<S> r;
  ExpCoefficients<S> k;
  Mat3<S> before;

  TRAJOPT_HD BallDirections(const Joint& joint, const S* q, const Transform<S>* joints,
                            const Twist<S>*)
      : r{q[joint.dof], q[joint.dof + 1], q[joint.dof + 2]},
        k(exp_coefficients(dot(r, r))),
        before(constant_rotation<S>(joint.offset)) {
    if (joint.parent >= 0) before = joints[joint.parent].rotation * before;
  }
  TRAJOPT_HD static int columns(int) { return 3; }
  TRAJOPT_HD Vec3<S> derivative(int row, int column) const {
    const int high = row > column ? row : column, low = row > column ? column : row;
    const Vec3<S> el{S(low == 0 ? 1.0 : 0.0), S(low == 1 ? 1.0 : 0.0), S(low == 2 ? 1.0 : 0.0)};
    const Vec3<S> eh{S(high == 0 ? 1.0 : 0.0), S(high == 1 ? 1.0 : 0.0), S(high == 2 ? 1.0 : 0.0)};
    Vec3<S> d = (k.da * r[high]) * el + k.b * cross(eh, el) + (k.db * r[high]) * cross(r, el) +
                k.c * (r[low] * eh) + (k.dc * r[high] * r[low]) * r;
    if (low == high) d += k.c * r;
    return before * d;
  }
};

// Inside a ball the order of its dofs matters beyond the geometric term.
template <class S, Chart C>
TRAJOPT_HD inline void add_ball_terms(const ModelView& model, int index, const S* const nodes[3],
                                      const Carried<S>& carried, const DynamicsWorkspace<S>& ws,
                                      S* const jacobians[3]) {
  const Joint& joint = model.joints[index];
  for (int t = 0; t < 3; ++t) {
    if (carried.wrench[t] == nullptr) continue;
    const Vec3<S> n = axial(carried.wrench[t]->moment);
    const Vec3<S>& origin = ws.joints[t][index].translation;
    const BallDirections<S, C> directions(joint, nodes[t], ws.joints[t], ws.twists[t]);
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < directions.columns(row); ++column) {
        const Vec3<S> dw = directions.derivative(row, column);
        jacobians[t][(joint.dof + row) * model.ndof + joint.dof + column] +=
            dot(dw, n) + dot(cross(origin, dw), carried.wrench[t]->force);
      }
    }
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
  for (int j = 0; j < model.njoint; ++j) {
    ws.slot[j] = -1;
    for (int t = 0; t < 3; ++t) ws.felt[t][j] = -1;
  }
  if constexpr (Derivatives) {
    for (int q = 0; q < 3; ++q)
      for (int i = 0; i < d * d; ++i) jacobians[q][i] = S(0.0);
  }
  if (physics.contact()) add_contacts<S, Derivatives>(model, physics, stencil, ws, jacobians);
  ws.coupled = physics.self_collision > 0 &&
               add_self_collision<S, Derivatives>(model, physics, a, ws,
                                                  Derivatives ? jacobians[a] : nullptr);

  for (int index = model.njoint - 1; index >= 0; --index) {
    const Joint& joint = model.joints[index];
    add_link<S, Derivatives>(joint, physics, stencil, a, index, ws);
    Carried<S> carried;
    for (int t = 0; t < 3; ++t)
      carried.wrench[t] = ws.felt[t][index] < 0 ? nullptr : &ws.wrenches[t][ws.felt[t][index]];
    const int last = joint.dof + (joint.type == JointType::ball ? 2 : 0);
    for (int j = joint.dof; j <= last; ++j) {
      S residual = S(0.0);
      for (int t = 0; t < 3; ++t) {
        if (carried.wrench[t] == nullptr) continue;
        const Twist<S>& xi = ws.twists[t][j];
        residual +=
            dot(xi.w, axial(carried.wrench[t]->moment)) + dot(xi.v, carried.wrench[t]->force);
      }
      fd[j] = residual;
    }
    if constexpr (Derivatives) {
      carried.second = ws.second[ws.slot[index]].q;
      carried.first = ws.first[index].q;
      carried.mass = S(joint.subtree_mass);
      for (int j = joint.dof; j <= last; ++j)
        add_pairs(model, stencil, a, j, carried, ws, jacobians);
      if (joint.type == JointType::ball)
        add_ball_terms<S, C>(model, index, nodes, carried, ws, jacobians);
    }
    if (joint.parent >= 0) add_to_parent<S, Derivatives>(joint.parent, index, ws);
  }
  add_joint_limits<S, C, Derivatives>(model, physics, nodes[a], fd,
                                      Derivatives ? jacobians[a] : nullptr);
}

}  // namespace trajopt::inline TRAJOPT_ISA
