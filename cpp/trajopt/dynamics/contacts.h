// Contact forces of all points at every node that has weight, and their derivatives.
//
// The force on point c at node t depends on P_t and on the velocity sum_q velocity_tq P_q. Along a
// dof l it changes by sum_q A_tq dP_q/dx_l(q), A_tq = [q = t] dF/dP + velocity_tq dF/dv. The point
// moves with the few dofs of its chain, so what reaches the Jacobians is, for each node q, a
// product of rank three over that chain: (sum_t A_tq^T dP_t/dx_j) . dP_q/dx_l.
#pragma once

#include "trajopt/base/products.h"
#include "trajopt/dynamics/composites.h"
#include "trajopt/force/contact.h"

namespace trajopt::inline TRAJOPT_ISA {

// The dofs that move a joint's link, ascending; returns how many.
TRAJOPT_HD inline int chain_of(const ModelView& model, int joint, int* dofs) {
  const Joint& tip = model.joints[joint];
  const int last = tip.dof + (tip.type == JointType::ball ? 2 : 0);
  int n = 0;
  for (int j = last; j >= 0; j = model.dof_parent[j]) ++n;
  int k = n;
  for (int j = last; j >= 0; j = model.dof_parent[j]) dofs[--k] = j;
  return n;
}

// dP/dx of dof j at node q.
template <class S>
TRAJOPT_HD inline Vec3<S> point_direction(const ModelView& model, const DynamicsWorkspace<S>& ws,
                                          int j, int q, const Vec3<S>& p) {
  const Twist<S>& xi = ws.twists[q][j];
  const bool slide = model.joints[model.dof_joint[j]].type == JointType::slide;
  return slide ? xi.v : point_velocity(xi, p);
}

// out[k n + i] = component k of it for the i-th dof of the chain.
template <class S>
TRAJOPT_HD inline void point_directions(const ModelView& model, const DynamicsWorkspace<S>& ws,
                                        const int* chain, int n, int q, const Vec3<S>& p, S* out) {
  for (int i = 0; i < n; ++i) {
    const Vec3<S> v = point_direction(model, ws, chain[i], q, p);
    for (int k = 0; k < 3; ++k) out[k * n + i] = v[k];
  }
}

// What a point's force does to the dofs of its chain when they move: tested and directions, 3 nodes
// x 3 rows x chain each.
template <class S>
TRAJOPT_HD inline void point_stiffness(const StencilPack<S>& stencil, const bool* active,
                                       const ContactForce<S>* contacts, int n, const S* directions,
                                       S* tested) {
  for (int i = 0; i < n; ++i) {
    Vec3<S> sum[3];
    for (Vec3<S>& v : sum) clear(v);
    for (int t = 0; t < 3; ++t) {
      if (!active[t]) continue;
      const S* column = directions + t * 3 * n + i;
      const Vec3<S> direction{column[0], column[n], column[2 * n]};
      const Vec3<S> by_velocity = transposed_times(contacts[t].by_velocity, direction);
      const S weight = -stencil.contact[t];
      sum[t] = fma(weight, transposed_times(contacts[t].by_position, direction), sum[t]);
      for (int q = 0; q < 3; ++q)
        sum[q] = fma(weight * stencil.velocity[t][q], by_velocity, sum[q]);
    }
    for (int q = 0; q < 3; ++q)
      for (int k = 0; k < 3; ++k) tested[(q * 3 + k) * n + i] = sum[q][k];
  }
}

// Points of one joint that wait for their products: neighbours on a foot share the chain, and what
// a Jacobian holds of it is then read and written once for all of them.
template <class S>
struct WaitingPoints {
  int joint = -1, count = 0, n = 0;  // n: dofs of the chain

  TRAJOPT_HD S* directions(const DynamicsWorkspace<S>& ws) const {
    return ws.directions + count * 9 * n;
  }
  TRAJOPT_HD S* tested(const DynamicsWorkspace<S>& ws) const { return ws.tested + count * 9 * n; }

  TRAJOPT_HD void add_to(const ModelView& model, const DynamicsWorkspace<S>& ws,
                         S* const jacobians[3]) {
    for (int q = 0; q < 3 && count > 0; ++q) {
      Panel<S> panels[DynamicsWorkspace<S>::kPoints];
      for (int k = 0; k < count; ++k) {
        const int at = (k * 3 + q) * 3 * n;
        panels[k] = {ws.tested + at, ws.directions + at, 3};
      }
      add_products(panels, count, ws.chain, n, false, false, jacobians[q], model.ndof);
    }
    count = 0;
  }
};

template <class S, bool Derivatives>
TRAJOPT_HD inline void add_contacts(const ModelView& model, const Physics& physics,
                                    const StencilPack<S>& stencil, DynamicsWorkspace<S>& ws,
                                    S* const jacobians[3]) {
  bool weighted[3];
  WaitingPoints<S> waiting;
  for (int t = 0; t < 3; ++t) weighted[t] = any(stencil.contact[t] > S(0.0));
  for (int c = 0; c < model.npoint; ++c) {
    const ContactPoint& point = model.points[c];
    const Vec3<S> local = broadcast3<S>(point.position);
    Vec3<S> p[3];
    S depth[3];
    bool active[3];
    for (int t = 0; t < 3; ++t) {
      p[t] = apply(ws.joints[t][point.joint], local);
      depth[t] = ground_depth(physics, p[t], point.radius);
      active[t] = weighted[t] && any(depth[t] > S(0.0));
    }
    if (!active[0] && !active[1] && !active[2]) continue;
    ContactForce<S> contacts[3];
    for (int t = 0; t < 3; ++t) {
      if (!active[t]) continue;
      Vec3<S> velocity = stencil.velocity[t][0] * p[0];
      velocity = fma(stencil.velocity[t][1], p[1], velocity);
      velocity = fma(stencil.velocity[t][2], p[2], velocity);
      contact_force<S, Derivatives>(physics, depth[t], velocity, contacts[t]);
      add_force(ws, t, point.joint, -stencil.contact[t], contacts[t].force, p[t]);
    }
    if constexpr (Derivatives) {
      if (point.joint != waiting.joint || waiting.count == DynamicsWorkspace<S>::kPoints)
        waiting.add_to(model, ws, jacobians);
      if (point.joint != waiting.joint) {
        waiting.joint = point.joint;
        waiting.n = chain_of(model, point.joint, ws.chain);
      }
      const int n = waiting.n;
      S* directions = waiting.directions(ws);
      for (int q = 0; q < 3; ++q)
        point_directions(model, ws, ws.chain, n, q, p[q], directions + q * 3 * n);
      point_stiffness(stencil, active, contacts, n, directions, waiting.tested(ws));
      ++waiting.count;
    }
  }
  if constexpr (Derivatives) waiting.add_to(model, ws, jacobians);
}

}  // namespace trajopt::inline TRAJOPT_ISA
