// Rows about the contact points that make motions a time grid can resolve:
//
//   contact_rate  (F(P_i, v_i) - F(P_{i-1}, v_{i-1}))/dt: contacts load and unload gently
//   contact_slip  sqrt(w_n) d v_t: loaded points stand still; |row|^2 = normal force * slip^2
//   contact_impact  sqrt(w_n) d v_n with d of frame i and of frame i-1: points come down and lift
//                   slowly, so that none crosses its whole depth within one frame
//
// with v by backward differences. Points that touch nothing in any lane have no rows.
#pragma once

#include "trajopt/problem/row_list.h"

namespace trajopt::inline TRAJOPT_ISA {

// Rows with the derivatives by[q], of which the first `Rows` count, by the point at nodes
// 0 .. nodes - 1.
template <int Rows, class S>
TRAJOPT_HD inline void add_rows_of_point(const ModelView& model, const DynamicsWorkspace<S>& ws,
                                         int joint, const Vec3<S>* p, const Mat3<S>* by, int nodes,
                                         RowList<S>& out) {
  int* chain = out.dofs();
  const int n = chain_of(model, joint, chain);
  for (int q = 0; q < nodes; ++q) {
    S* to = out.jacobian() + q * Rows * n;
    for (int i = 0; i < n; ++i) {
      const Vec3<S> column = by[q] * point_direction(model, ws, chain[i], q, p[q]);
      for (int k = 0; k < Rows; ++k) to[k * n + i] = column[k];
    }
  }
  const bool all = n == model.ndof;
  out.add(all ? RowList<S>::kEverywhere : chain[n - 1], Rows, nodes, n,
          all ? out.every_dof() : chain);
}

template <class S, bool Derivatives>
TRAJOPT_HD inline void contact_rate_rows(const ModelView& model, const Physics& physics,
                                         DynamicsWorkspace<S>& ws, const S& scale,
                                         const S& inverse_dt, const S& inverse_dt_before,
                                         RowList<S>& out) {
  const S c = scale * inverse_dt;
  for (int k = 0; physics.contact() && k < model.npoint; ++k) {
    const ContactPoint& point = model.points[k];
    const Vec3<S> local = broadcast3<S>(point.position);
    Vec3<S> p[3];
    for (int q = 0; q < 2; ++q) p[q] = apply(ws.joints[q][point.joint], local);
    const S depth[2] = {ground_depth(physics, p[0], point.radius),
                        ground_depth(physics, p[1], point.radius)};
    if (!any(depth[0] > S(0.0)) && !any(depth[1] > S(0.0))) continue;
    p[2] = apply(ws.joints[2][point.joint], local);
    ContactForce<S> now, before;
    contact_force<S, Derivatives>(physics, depth[0], inverse_dt * (p[0] - p[1]), now);
    contact_force<S, Derivatives>(physics, depth[1], inverse_dt_before * (p[1] - p[2]), before);
    for (int i = 0; i < 3; ++i) out.residual()[i] = c * (now.force[i] - before.force[i]);
    if constexpr (Derivatives) {
      Mat3<S> by[3];  // derivative of the row by the point at each node
      for (int i = 0; i < 9; ++i) {
        const S vn = inverse_dt * now.by_velocity.m[i];
        const S vb = inverse_dt_before * before.by_velocity.m[i];
        by[0].m[i] = c * (now.by_position.m[i] + vn);
        by[1].m[i] = -c * (vn + before.by_position.m[i] + vb);
        by[2].m[i] = c * vb;
      }
      add_rows_of_point<3>(model, ws, point.joint, p, by, 3, out);
    } else {
      out.add_residuals(3);
    }
  }
}

template <class S, bool Derivatives>
TRAJOPT_HD inline void contact_slip_rows(const ModelView& model, const Physics& physics,
                                         DynamicsWorkspace<S>& ws, const S& scale,
                                         const S& inverse_dt, RowList<S>& out) {
  const S c = scale * S(__builtin_sqrt(physics.normal));
  const Vec3<S> n = broadcast3<S>(physics.plane_normal);
  for (int k = 0; physics.contact() && k < model.npoint; ++k) {
    const ContactPoint& point = model.points[k];
    const Vec3<S> local = broadcast3<S>(point.position);
    Vec3<S> p[2];
    p[0] = apply(ws.joints[0][point.joint], local);
    const S depth = max(ground_depth(physics, p[0], point.radius), S(0.0));
    if (!any(depth > S(0.0))) continue;
    p[1] = apply(ws.joints[1][point.joint], local);
    const S touches = select(depth > S(0.0), S(1.0), S(0.0));
    const Vec3<S> v = inverse_dt * (p[0] - p[1]);
    const Vec3<S> vt = fma(-dot(n, v), n, v);
    for (int i = 0; i < 3; ++i) out.residual()[i] = c * depth * vt[i];
    if constexpr (Derivatives) {
      Mat3<S> by[2];
      for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) {
          const S tangent = S(i == j ? 1.0 : 0.0) - n[i] * n[j];
          const S rate = c * depth * inverse_dt * tangent;
          by[0](i, j) = rate - c * touches * vt[i] * n[j];
          by[1](i, j) = -rate;
        }
      }
      add_rows_of_point<3>(model, ws, point.joint, p, by, 2, out);
    } else {
      out.add_residuals(3);
    }
  }
}

// The first row catches a point that strikes the ground, the second one that leaves it.
template <class S, bool Derivatives>
TRAJOPT_HD inline void contact_impact_rows(const ModelView& model, const Physics& physics,
                                           DynamicsWorkspace<S>& ws, const S& scale,
                                           const S& inverse_dt, RowList<S>& out) {
  const S c = scale * S(__builtin_sqrt(physics.normal));
  const Vec3<S> n = broadcast3<S>(physics.plane_normal);
  for (int k = 0; physics.contact() && k < model.npoint; ++k) {
    const ContactPoint& point = model.points[k];
    const Vec3<S> local = broadcast3<S>(point.position);
    Vec3<S> p[2];
    S depth[2];
    for (int q = 0; q < 2; ++q) {
      p[q] = apply(ws.joints[q][point.joint], local);
      depth[q] = max(ground_depth(physics, p[q], point.radius), S(0.0));
    }
    if (!any(depth[0] > S(0.0)) && !any(depth[1] > S(0.0))) continue;
    const S vn = inverse_dt * dot(n, p[0] - p[1]);
    for (int q = 0; q < 2; ++q) out.residual()[q] = c * depth[q] * vn;
    if constexpr (Derivatives) {
      Mat3<S> by[2];  // row q, of depth q, by the point at node r
      for (int q = 0; q < 2; ++q) {
        const S touches = select(depth[q] > S(0.0), S(1.0), S(0.0));
        const S rate = c * depth[q] * inverse_dt, sinks = c * touches * vn;
        for (int j = 0; j < 3; ++j) {
          by[0](q, j) = (q == 0 ? rate - sinks : rate) * n[j];
          by[1](q, j) = (q == 1 ? -rate - sinks : -rate) * n[j];
        }
      }
      add_rows_of_point<2>(model, ws, point.joint, p, by, 2, out);
    } else {
      out.add_residuals(2);
    }
  }
}

}  // namespace trajopt::inline TRAJOPT_ISA
