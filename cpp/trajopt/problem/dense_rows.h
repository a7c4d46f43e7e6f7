// Objective rows that reach across the tree: residual and Jacobian over the window of three nodes.
#pragma once

#include "trajopt/problem/frame_kernels.h"
#include "trajopt/problem/row_list.h"

namespace trajopt::inline TRAJOPT_ISA {

// Derivative of the centre of mass at node q with respect to dof j.
template <class S>
TRAJOPT_HD inline Vec3<S> com_direction(const ModelView& model, const DynamicsWorkspace<S>& ws,
                                        int q, int j) {
  const int joint = model.dof_joint[j];
  const Twist<S>& xi = ws.twists[q][j];
  const S inverse = S(1.0 / model.mass);
  const S mass = S(model.joints[joint].subtree_mass);
  return inverse * fma(mass, xi.v, cross(xi.w, ws.first[joint].q[q]));
}

template <class S>
TRAJOPT_HD inline Vec3<S> center_of_mass(const ModelView& model, const DynamicsWorkspace<S>& ws,
                                         int q) {
  Vec3<S> sum{S(0.0), S(0.0), S(0.0)};
  for (int j = 0; j < model.njoint; ++j)
    if (model.joints[j].parent < 0) sum += ws.first[j].q[q];
  return S(1.0 / model.mass) * sum;
}

// The dofs whose motion changes the force on dof `dof`: those towards the root, those behind it.
TRAJOPT_HD inline int path_of(const ModelView& model, int dof, int* dofs) {
  int n = 0;
  for (int j = dof; j >= 0; j = model.dof_parent[j]) ++n;
  int k = n;
  for (int j = dof; j >= 0; j = model.dof_parent[j]) dofs[--k] = j;
  for (int j = dof + 1; j < model.ndof; ++j) {
    int up = j;
    while (up > dof) up = model.dof_parent[up];
    if (up == dof) dofs[n++] = j;
  }
  return n;
}

template <class S>
TRAJOPT_HD inline void force_residuals(const int* rows, int count, const S* fd, const S& scale,
                                       S* out) {
  for (int r = 0; r < count; ++r) out[r] = scale * fd[rows[r]];
}

// Rows scale * FD of some dofs, one set for each run of dofs that feel the same ones. `fd` null:
// not part of the objective.
template <class S>
TRAJOPT_HD inline void force_rows(const ModelView& model, const int* rows, int count,
                                  const DynamicsWorkspace<S>& ws, const S* fd,
                                  const S* const jacobians[3], const S& scale, RowList<S>& out) {
  const int d = model.ndof;
  for (int begin = 0, end; begin < count; begin = end) {
    int* path = out.dofs();
    const int reach = path_of(model, rows[begin], path);
    for (end = begin + 1; end < count; ++end) {
      int* other = path + reach;
      bool same = path_of(model, rows[end], other) == reach;
      for (int i = 0; same && i < reach; ++i) same = other[i] == path[i];
      if (!same) break;
    }
    const int place = reach == d ? RowList<S>::kEverywhere : path[reach - 1];
    // Overlapping spheres push branches apart that are not on one path.
    const int n = ws.coupled ? d : reach;
    const int* dofs = n == d ? out.every_dof() : path;
    S* to = out.jacobian();
    for (int q = 0; q < 3; ++q) {
      for (int r = begin; r < end; ++r) {
        const S* from = jacobians[q] + rows[r] * d;
        for (int i = 0; i < n; ++i) *to++ = scale * from[dofs[i]];
      }
    }
    if (fd != nullptr) force_residuals(rows + begin, end - begin, fd, scale, out.residual());
    out.add(place, end - begin, 3, n, dofs, fd != nullptr);
  }
}

// A tracked point (centre of mass or body point) at node q: its place.
template <class S>
TRAJOPT_HD inline Vec3<S> tracked_point(const ModelView& model, const DenseTerm& term, bool com,
                                        const DynamicsWorkspace<S>& ws, int q) {
  return com ? center_of_mass(model, ws, q)
             : apply(ws.joints[q][term.joint], broadcast3<S>(term.point));
}

// scale: sqrt(2 weight) per lane; target: three packs; inverse_dt: 1/dt per lane.
template <class S, bool Derivatives>
TRAJOPT_HD inline void point_rows(const ModelView& model, const DenseTerm& term,
                                  DynamicsWorkspace<S>& ws, const S& scale, const Vec3<S>& target,
                                  const S& inverse_dt, RowList<S>& out) {
  const bool com = term.kind == DenseKind::center_of_mass_velocity ||
                   term.kind == DenseKind::center_of_mass_position;
  const bool rate =
      term.kind == DenseKind::center_of_mass_velocity || term.kind == DenseKind::point_velocity;
  const int nodes = rate ? 2 : 1;
  Vec3<S> weight, p[2];
  for (int k = 0; k < 3; ++k) weight[k] = scale * S(term.axes[k]);
  for (int q = 0; q < nodes; ++q) p[q] = tracked_point(model, term, com, ws, q);
  const Vec3<S> value = rate ? inverse_dt * (p[0] - p[1]) : p[0];
  for (int k = 0; k < 3; ++k) out.residual()[k] = weight[k] * (value[k] - target[k]);
  if constexpr (Derivatives) {
    const int d = model.ndof;
    const int n = com ? d : chain_of(model, term.joint, out.dofs());
    const int* dofs = n == d ? out.every_dof() : out.dofs();
    for (int q = 0; q < nodes; ++q) {
      const Vec3<S> unit = rate ? (q == 0 ? inverse_dt : -inverse_dt) * weight : weight;
      S* to = out.jacobian() + q * 3 * n;
      for (int i = 0; i < n; ++i) {
        const Vec3<S> direction = com ? com_direction(model, ws, q, dofs[i])
                                      : point_velocity(ws.twists[q][dofs[i]], p[q]);
        for (int k = 0; k < 3; ++k) to[k * n + i] = unit[k] * direction[k];
      }
    }
    out.add(n == d ? RowList<S>::kEverywhere : dofs[n - 1], 3, nodes, n, dofs);
  } else {
    out.add_residuals(3);
  }
}

}  // namespace trajopt::inline TRAJOPT_ISA
