// Joint-by-joint objective terms: value, and contribution to a frame's window.
#pragma once

#include "trajopt/model/model.h"
#include "trajopt/model/rotation.h"
#include "trajopt/problem/frame_kernels.h"
#include "trajopt/problem/objective.h"

namespace trajopt {

// What a kernel sees of a LocalObjective: plain pointers, also valid on a device.
struct LocalTerm {
  LocalKind kind;
  const double* weight;      // N
  const double* dof_weight;  // D
  const double* target;      // see LocalObjective; nullptr: none
};

// Frame f (0-based) with nodes q[0] = x_i, q[1] = x_{i-1}, q[2] = x_{i-2} and steps dt, dt_before.
struct LocalFrame {
  long index;
  const double* q[3];
  double dt, dt_before;
};

inline namespace TRAJOPT_ISA {

TRAJOPT_HD inline LocalFrame local_frame(const FrameInput& in, long f) {
  const int nq = in.model.nq;
  const double* x = in.frames + (f + 2) * nq;
  return {f, {x, x - nq, x - 2 * nq}, in.dt[f + 1], in.dt[f]};
}

// The residual of a term is c01 (x_i (-) x_{i-1}) + c12 (x_{i-1} (-) x_{i-2}) - target, or for a
// pose x_i (-) target.
struct LocalDifferences {
  double c01, c12;
  TRAJOPT_HD LocalDifferences(LocalKind kind, const LocalFrame& frame) {
    const double h = frame.dt, k = frame.dt_before, mean = 0.5 * (h + k);
    c01 = kind == LocalKind::velocity ? 1 / h : 1 / (mean * h);
    c12 = kind == LocalKind::velocity ? 0.0 : -1 / (mean * k);
  }
};

// Slide or hinge: one row with derivatives c[0], c[1], c[2] by the three nodes.
template <bool Derivatives>
TRAJOPT_HD inline double local_scalar(const LocalTerm& term, const LocalFrame& frame,
                                      const LocalDifferences& by, double weight, const Joint& joint,
                                      int d, int nq, double* hessian, double* gradient) {
  const int i = joint.dof, k = joint.q;
  double r, c[3] = {1.0, 0.0, 0.0};
  if (term.kind == LocalKind::pose) {
    r = frame.q[0][k] - term.target[frame.index * nq + k];
  } else {
    r = fma(by.c01, frame.q[0][k] - frame.q[1][k], by.c12 * (frame.q[1][k] - frame.q[2][k]));
    if (term.kind == LocalKind::velocity && term.target != nullptr)
      r -= term.target[frame.index * d + i];
    c[0] = by.c01;
    c[1] = by.c12 - by.c01;
    c[2] = -by.c12;
  }
  const double w = weight * term.dof_weight[i];
  if constexpr (Derivatives) {
    const int used = term.kind == LocalKind::pose ? 1 : (term.kind == LocalKind::velocity ? 2 : 3);
    for (int p = 0; p < used; ++p) gradient[p * d + i] += 2 * w * c[p] * r;
    for (int block = 0; block < 6; ++block) {
      const int p = kWindowBlocks[block][0], q = kWindowBlocks[block][1];
      if (q < used) hessian[(block * d + i) * d + i] += 2 * w * c[p] * c[q];
    }
  }
  return w * r * r;
}

// Ball: three rows, with a 3 x 3 derivative by each node.
template <bool Derivatives>
TRAJOPT_HD inline double local_ball(const LocalTerm& term, const LocalFrame& frame,
                                    const LocalDifferences& c, double weight, const Joint& joint,
                                    int d, int nq, double* hessian, double* gradient) {
  const int first = joint.dof, k = joint.q;
  int used = 1;
  double r[3], by[3][9];
  const auto add = [&](double c, const double* a, const double* b, double* by_a, double* by_b) {
    const Vec3<double> e = quaternion_difference(a, b);
    for (int i = 0; i < 3; ++i) r[i] = fma(c, e[i], r[i]);
    if constexpr (Derivatives) {
      const Mat3<double> j = left_jacobian_inverse(e);  // by a; by b it is -J^-1(-e), its transpose
      for (int i = 0; i < 9; ++i) by_a[i] = fma(c, j.m[i], by_a[i]);
      if (by_b == nullptr) return;
      for (int i = 0; i < 9; ++i) by_b[i] = fma(-c, j.m[i % 3 * 3 + i / 3], by_b[i]);
    }
  };
  for (double& x : r) x = 0.0;
  if constexpr (Derivatives) {
    for (auto& block : by)
      for (double& x : block) x = 0.0;
  }
  if (term.kind == LocalKind::pose) {
    add(1.0, frame.q[0] + k, term.target + frame.index * nq + k, by[0], nullptr);
  } else {
    add(c.c01, frame.q[0] + k, frame.q[1] + k, by[0], by[1]);
    used = 2;
    if (term.kind == LocalKind::acceleration) {
      add(c.c12, frame.q[1] + k, frame.q[2] + k, by[1], by[2]);
      used = 3;
    } else if (term.target != nullptr) {
      for (int i = 0; i < 3; ++i) r[i] -= term.target[frame.index * d + first + i];
    }
  }
  double w[3], cost = 0.0;
  for (int i = 0; i < 3; ++i) {
    w[i] = weight * term.dof_weight[first + i];
    cost = fma(w[i] * r[i], r[i], cost);
  }
  if constexpr (Derivatives) {
    const auto weighted = [&](const double* a, int i, const double* b) {  // 2 sum_row w a_i b
      return 2 * fma(w[2] * a[6 + i], b[2], fma(w[1] * a[3 + i], b[1], w[0] * a[i] * b[0]));
    };
    for (int p = 0; p < used; ++p)
      for (int i = 0; i < 3; ++i) gradient[p * d + first + i] += weighted(by[p], i, r);
    for (int block = 0; block < 6; ++block) {
      const int p = kWindowBlocks[block][0], q = kWindowBlocks[block][1];
      if (q >= used) continue;
      for (int j = 0; j < 3; ++j) {
        const double column[3] = {by[q][j], by[q][3 + j], by[q][6 + j]};
        for (int i = 0; i < 3; ++i)
          hessian[(block * d + first + i) * d + first + j] += weighted(by[p], i, column);
      }
    }
  }
  return cost;
}

// weight * |r|^2. With derivatives adds 2 w J^T J and 2 w J^T r to a window's hessian (6 x D x D)
// and gradient (3 x D).
template <bool Derivatives>
TRAJOPT_HD inline double add_local_term(const ModelView& model, const LocalTerm& term,
                                        const LocalFrame& frame, double* hessian,
                                        double* gradient) {
  const double weight = term.weight[frame.index];
  if (weight == 0) return 0.0;
  const LocalDifferences differences(term.kind, frame);
  double cost = 0.0;
  for (int j = 0; j < model.njoint; ++j) {
    const Joint& joint = model.joints[j];
    const auto add =
        joint.type == JointType::ball ? local_ball<Derivatives> : local_scalar<Derivatives>;
    cost += add(term, frame, differences, weight, joint, model.ndof, model.nq, hessian, gradient);
  }
  return cost;
}

}  // namespace TRAJOPT_ISA
}  // namespace trajopt
