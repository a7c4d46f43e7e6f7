// Objective rows that reach across the tree: residual and Jacobian over the window of three nodes.
#pragma once

#include "trajopt/dynamics/residual.h"
#include "trajopt/problem/frame_kernels.h"

namespace trajopt::inline TRAJOPT_ISA {

// Rows r (count) and jacobian (count x 3D), node q's columns at [q D, (q+1) D).
template <class S>
struct RowBlock {
  S* residual;
  S* jacobian;
};

// Derivative of the centre of mass at node q with respect to dof j.
template <class S>
TRAJOPT_HD inline Vec3<S> com_direction(const ModelView& model, const DynamicsWorkspace<S>& ws,
                                        int q, int j) {
  const int joint = model.dof_joint[j];
  const Twist<S>& xi = ws.twists[q][j];
  const S inverse = S(1.0 / model.mass);
  const S mass = S(model.joints[joint].subtree_mass);
  return inverse * fma(mass, xi.v, cross(xi.w, ws.composites[joint].first[q]));
}

template <class S>
TRAJOPT_HD inline Vec3<S> center_of_mass(const ModelView& model, const DynamicsWorkspace<S>& ws,
                                         int q) {
  Vec3<S> sum{S(0.0), S(0.0), S(0.0)};
  for (int j = 0; j < model.njoint; ++j)
    if (model.joints[j].parent < 0) sum += ws.composites[j].first[q];
  return S(1.0 / model.mass) * sum;
}

// A vector-valued point (centre of mass or body point) at node q and its directions.
template <class S, bool Derivatives>
TRAJOPT_HD inline Vec3<S> tracked_point(const ModelView& model, const DenseTerm& term,
                                        const DynamicsWorkspace<S>& ws, int q, const Vec3<S>& scale,
                                        S* columns, int stride) {
  const bool com = term.kind == DenseKind::center_of_mass_velocity ||
                   term.kind == DenseKind::center_of_mass_position;
  if constexpr (Derivatives) {
    const auto put = [&](int j, const Vec3<S>& direction) {
      for (int k = 0; k < 3; ++k) columns[k * stride + j] = scale[k] * direction[k];
    };
    if (com) {
      for (int j = 0; j < model.ndof; ++j) put(j, com_direction(model, ws, q, j));
    } else {
      const Vec3<S> p = apply(ws.joints[q][term.joint], broadcast3<S>(term.point));
      const Joint& joint = model.joints[term.joint];
      for (int j = joint.dof + joint.ndof() - 1; j >= 0; j = model.dof_parent[j])
        put(j, point_velocity(ws.twists[q][j], p));
    }
  }
  return com ? center_of_mass(model, ws, q)
             : apply(ws.joints[q][term.joint], broadcast3<S>(term.point));
}

// scale: sqrt(2 weight) per lane; target: three packs; inverse_dt: 1/dt per lane.
template <class S, bool Derivatives>
TRAJOPT_HD inline void dense_rows(const ModelView& model, const DenseTerm& term,
                                  const DynamicsWorkspace<S>& ws, const S* fd,
                                  const S* const jacobians[3], const S& scale,
                                  const Vec3<S>& target, const S& inverse_dt, RowBlock<S> out) {
  const int d = model.ndof, width = 3 * d;
  const int count = rows_of(term.kind, model);
  if constexpr (Derivatives) {
    for (int i = 0; i < count * width; ++i) out.jacobian[i] = S(0.0);
  }
  if (term.kind == DenseKind::effort || term.kind == DenseKind::physics) {
    const int* dofs = term.kind == DenseKind::effort ? model.actuated : model.unactuated;
    for (int r = 0; r < count; ++r) {
      const int row = dofs[r];
      out.residual[r] = scale * fd[row];
      if constexpr (Derivatives) {
        for (int q = 0; q < 3; ++q)
          for (int j = 0; j < d; ++j)
            out.jacobian[r * width + q * d + j] = scale * jacobians[q][row * d + j];
      }
    }
    return;
  }
  const bool rate =
      term.kind == DenseKind::center_of_mass_velocity || term.kind == DenseKind::point_velocity;
  Vec3<S> weight;
  for (int k = 0; k < 3; ++k) weight[k] = scale * S(term.axes[k]);
  const Vec3<S> unit = rate ? inverse_dt * weight : weight;
  Vec3<S> value = tracked_point<S, Derivatives>(model, term, ws, 0, unit, out.jacobian, width);
  if (rate) {
    const Vec3<S> minus = S(-1.0) * unit;
    value =
        value - tracked_point<S, Derivatives>(model, term, ws, 1, minus, out.jacobian + d, width);
    value = inverse_dt * value;
  }
  for (int k = 0; k < 3; ++k) out.residual[k] = weight[k] * (value[k] - target[k]);
}

}  // namespace trajopt::inline TRAJOPT_ISA
