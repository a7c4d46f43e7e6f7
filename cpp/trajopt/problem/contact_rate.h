// Rows that make contacts load and unload gently: (F(P_i, v_i) - F(P_{i-1}, v_{i-1}))/dt of every
// contact point, v by backward differences. What a time grid cannot resolve is a force that changes
// within a frame; this term says what that costs.
#pragma once

#include "trajopt/dynamics/residual.h"
#include "trajopt/problem/dense_rows.h"

namespace trajopt::inline TRAJOPT_ISA {

// Returns the number of rows written: three for each point that touches in any lane.
template <class S, bool Derivatives>
TRAJOPT_HD inline int contact_rate_rows(const ModelView& model, const Physics& physics,
                                        const DynamicsWorkspace<S>& ws, const S& scale,
                                        const S& inverse_dt, const S& inverse_dt_before,
                                        RowBlock<S> out) {
  const int d = model.ndof, width = 3 * d;
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
      S* rows_out = out.jacobian + rows * width;
      for (int i = 0; i < 3 * width; ++i) rows_out[i] = S(0.0);
      Mat3<S> by[3];  // derivative of the row by the point at each node
      for (int i = 0; i < 9; ++i) {
        const S vn = inverse_dt * now.by_velocity.m[i];
        const S vb = inverse_dt_before * before.by_velocity.m[i];
        by[0].m[i] = c * (now.by_position.m[i] + vn);
        by[1].m[i] = -c * (vn + before.by_position.m[i] + vb);
        by[2].m[i] = c * vb;
      }
      const Joint& joint = model.joints[point.joint];
      for (int q = 0; q < 3; ++q) {
        for (int j = joint.dof + joint.ndof() - 1; j >= 0; j = model.dof_parent[j]) {
          const Vec3<S> column = by[q] * point_velocity(ws.twists[q][j], p[q]);
          for (int i = 0; i < 3; ++i) rows_out[i * width + q * d + j] = column[i];
        }
      }
    }
    rows += 3;
  }
  return rows;
}

}  // namespace trajopt::inline TRAJOPT_ISA
