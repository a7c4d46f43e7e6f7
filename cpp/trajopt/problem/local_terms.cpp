#include "trajopt/problem/local_terms.h"

#include "trajopt/model/rotation.h"

namespace trajopt {

namespace {

// Residual of one joint (1 or 3 rows) and its derivative by each node's tangent.
struct JointRows {
  int n = 1;
  bool used[3] = {false, false, false};
  double r[3] = {0, 0, 0};
  double j[3][9] = {};  // n x n, row-major with stride n
};

// rows += c * (a (-) b), nodes na and nb; b may be a constant (nb < 0).
void add_difference(const Joint& joint, double c, const double* a, int na, const double* b, int nb,
                    JointRows& rows) {
  rows.used[na] = true;
  if (nb >= 0) rows.used[nb] = true;
  if (joint.type != JointType::ball) {
    rows.r[0] += c * (a[joint.q] - b[joint.q]);
    rows.j[na][0] += c;
    if (nb >= 0) rows.j[nb][0] -= c;
    return;
  }
  const Vec3<double> e = quaternion_difference(a + joint.q, b + joint.q);
  const Mat3<double> by_a = left_jacobian_inverse(e);
  const Mat3<double> by_b = left_jacobian_inverse(Vec3<double>{-e.x, -e.y, -e.z});
  for (int k = 0; k < 3; ++k) rows.r[k] += c * e[k];
  for (int k = 0; k < 9; ++k) {
    rows.j[na][k] += c * by_a.m[k];
    if (nb >= 0) rows.j[nb][k] -= c * by_b.m[k];
  }
}

}  // namespace

double add_local_term(const Model& model, const LocalObjective& term, const LocalFrame& frame,
                      double* hessian, double* gradient) {
  const double weight = term.weight[frame.index];
  if (weight == 0) return 0;
  const int d = model.ndof;
  double cost = 0;
  for (const Joint& joint : model.joints) {
    JointRows rows;
    rows.n = joint.ndof();
    const double h = frame.dt, k = frame.dt_before;
    switch (term.kind) {
      case LocalKind::pose:
        add_difference(joint, 1.0, frame.q[0], 0, term.target.data() + frame.index * model.nq, -1,
                       rows);
        break;
      case LocalKind::velocity:
        add_difference(joint, 1 / h, frame.q[0], 0, frame.q[1], 1, rows);
        if (!term.target.empty())
          for (int i = 0; i < rows.n; ++i)
            rows.r[i] -= term.target[frame.index * d + joint.dof + i];
        break;
      case LocalKind::acceleration: {
        const double mean = 0.5 * (h + k);
        add_difference(joint, 1 / (mean * h), frame.q[0], 0, frame.q[1], 1, rows);
        add_difference(joint, -1 / (mean * k), frame.q[1], 1, frame.q[2], 2, rows);
        break;
      }
    }
    const int n = rows.n;
    double w[3];
    for (int i = 0; i < n; ++i) {
      w[i] = weight * term.dof_weight[joint.dof + i];
      cost += w[i] * rows.r[i] * rows.r[i];
    }
    if (hessian == nullptr) continue;
    for (int p = 0; p < 3; ++p) {
      if (!rows.used[p]) continue;
      for (int i = 0; i < n; ++i) {
        double sum = 0;
        for (int row = 0; row < n; ++row) sum += 2 * w[row] * rows.j[p][row * n + i] * rows.r[row];
        gradient[p * d + joint.dof + i] += sum;
      }
    }
    for (int block = 0; block < 6; ++block) {
      const int p = kWindowBlocks[block][0], q = kWindowBlocks[block][1];
      if (!rows.used[p] || !rows.used[q]) continue;
      double* out = hessian + block * d * d;
      for (int i = 0; i < n; ++i) {
        for (int j = 0; j < n; ++j) {
          double sum = 0;
          for (int row = 0; row < n; ++row)
            sum += 2 * w[row] * rows.j[p][row * n + i] * rows.j[q][row * n + j];
          out[(joint.dof + i) * d + joint.dof + j] += sum;
        }
      }
    }
  }
  return cost;
}

}  // namespace trajopt
