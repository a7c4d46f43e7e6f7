// Rows about the contact points that make motions a time grid can resolve:
//
//   contact_rate  (F(P_i, v_i) - F(P_{i-1}, v_{i-1}))/dt: contacts load and unload gently
//   contact_slip  sqrt(w_n) d v_t: loaded points stand still; |row|^2 = normal force * slip^2
//
// with v by backward differences. Points that touch nothing in any lane have no rows.
#pragma once

#include "trajopt/dynamics/residual.h"
#include "trajopt/problem/dense_rows.h"

namespace trajopt::inline TRAJOPT_ISA {

// rows[i][q D + j] = (by[q] dP_q/dx_j)_i for the three rows of one point.
template <class S>
TRAJOPT_HD inline void point_rows(const ModelView& model, const DynamicsWorkspace<S>& ws, int joint,
                                  const Vec3<S>* p, const Mat3<S>* by, S* rows) {
  const int d = model.ndof, width = 3 * d;
  for (int i = 0; i < 3 * width; ++i) rows[i] = S(0.0);
  const int last = model.joints[joint].dof + model.joints[joint].ndof() - 1;
  for (int q = 0; q < 3; ++q) {
    for (int j = last; j >= 0; j = model.dof_parent[j]) {
      const Vec3<S> column = by[q] * point_velocity(ws.twists[q][j], p[q]);
      for (int i = 0; i < 3; ++i) rows[i * width + q * d + j] = column[i];
    }
  }
}

// Returns the number of rows written: three for each point that touches in any lane.
template <class S, bool Derivatives>
TRAJOPT_HD inline int contact_rate_rows(const ModelView& model, const Physics& physics,
                                        const DynamicsWorkspace<S>& ws, const S& scale,
                                        const S& inverse_dt, const S& inverse_dt_before,
                                        RowBlock<S> out) {
  const int width = 3 * model.ndof;
  const S c = scale * inverse_dt;
  int rows = 0;
  for (int k = 0; physics.contact() && k < model.npoint; ++k) {
    const ContactPoint& point = model.points[k];
    const Vec3<S> local = broadcast3<S>(point.position);
    Vec3<S> p[3];
    for (int q = 0; q < 3; ++q) p[q] = apply(ws.joints[q][point.joint], local);
    const S depth[2] = {ground_depth(physics, p[0], point.radius),
                        ground_depth(physics, p[1], point.radius)};
    if (!any(depth[0] > S(0.0)) && !any(depth[1] > S(0.0))) continue;
    ContactForce<S> now, before;
    contact_force<S, Derivatives>(physics, depth[0], inverse_dt * (p[0] - p[1]), now);
    contact_force<S, Derivatives>(physics, depth[1], inverse_dt_before * (p[1] - p[2]), before);
    for (int i = 0; i < 3; ++i) out.residual[rows + i] = c * (now.force[i] - before.force[i]);
    if constexpr (Derivatives) {
      Mat3<S> by[3];  // derivative of the row by the point at each node
      for (int i = 0; i < 9; ++i) {
        const S vn = inverse_dt * now.by_velocity.m[i];
        const S vb = inverse_dt_before * before.by_velocity.m[i];
        by[0].m[i] = c * (now.by_position.m[i] + vn);
        by[1].m[i] = -c * (vn + before.by_position.m[i] + vb);
        by[2].m[i] = c * vb;
      }
      point_rows(model, ws, point.joint, p, by, out.jacobian + rows * width);
    }
    rows += 3;
  }
  return rows;
}

template <class S, bool Derivatives>
TRAJOPT_HD inline int contact_slip_rows(const ModelView& model, const Physics& physics,
                                        const DynamicsWorkspace<S>& ws, const S& scale,
                                        const S& inverse_dt, RowBlock<S> out) {
  const int width = 3 * model.ndof;
  const S c = scale * S(__builtin_sqrt(physics.normal));
  const Vec3<S> n = broadcast3<S>(physics.plane_normal);
  int rows = 0;
  for (int k = 0; physics.contact() && k < model.npoint; ++k) {
    const ContactPoint& point = model.points[k];
    const Vec3<S> local = broadcast3<S>(point.position);
    Vec3<S> p[3];
    for (int q = 0; q < 2; ++q) p[q] = apply(ws.joints[q][point.joint], local);
    p[2] = p[1];
    const S depth = max(ground_depth(physics, p[0], point.radius), S(0.0));
    if (!any(depth > S(0.0))) continue;
    const S touches = select(depth > S(0.0), S(1.0), S(0.0));
    const Vec3<S> v = inverse_dt * (p[0] - p[1]);
    const Vec3<S> vt = fma(-dot(n, v), n, v);
    for (int i = 0; i < 3; ++i) out.residual[rows + i] = c * depth * vt[i];
    if constexpr (Derivatives) {
      Mat3<S> by[3];
      for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) {
          const S tangent = S(i == j ? 1.0 : 0.0) - n[i] * n[j];
          const S rate = c * depth * inverse_dt * tangent;
          by[0](i, j) = rate - c * touches * vt[i] * n[j];
          by[1](i, j) = -rate;
          by[2](i, j) = S(0.0);
        }
      }
      point_rows(model, ws, point.joint, p, by, out.jacobian + rows * width);
    }
    rows += 3;
  }
  return rows;
}

}  // namespace trajopt::inline TRAJOPT_ISA
