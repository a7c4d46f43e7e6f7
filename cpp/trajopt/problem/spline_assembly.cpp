// Assembly of the KKT matrix for the Hermite spline: frame blocks projected with the stencil S.
#include <algorithm>

#include "trajopt/problem/kkt_system.h"

namespace trajopt {

namespace {

// columns (rows x D) times the frame's tangent by one half of a control point (D x D, diagonal but
// for balls).
void times_weight(const Model& model, const SplineWeight& w, const double* in, int rows,
                  double* out) {
  const int d = model.ndof;
  for (int r = 0; r < rows; ++r) {
    const double* a = in + static_cast<long>(r) * d;
    double* b = out + static_cast<long>(r) * d;
    int ball = 0;
    for (const Joint& joint : model.joints) {
      const int j = joint.dof;
      if (joint.type != JointType::ball) {
        b[j] = w.value * a[j];
        continue;
      }
      const double* t = w.rotation + 9 * ball++;
      for (int k = 0; k < 3; ++k)
        b[j + k] = a[j] * t[k] + a[j + 1] * t[3 + k] + a[j + 2] * t[6 + k];
    }
  }
}

void transpose(const double* in, int d, double* out) {
  for (int i = 0; i < d; ++i)
    for (int j = 0; j < d; ++j) out[j * d + i] = in[i * d + j];
}

}  // namespace

void KktSystem::assemble_spline(const Linearization& lin, double damping, bool identity) {
  const Model& model = problem_.model();
  const HermiteSpline& spline = problem_.spline();
  const int d = model.ndof, n = problem_.frame_count();
  const long dd = static_cast<long>(d) * d;
  for (int node = 0; node < nodes_; ++node) {
    for (int k = 0; k < primal_; ++k) put(node, dual_ + k, node, dual_ + k, 1, 1, &damping, 1, 1);
  }
  std::vector<double> band(dd), right(dd), right_t(dd), both(dd);
  if (!identity) {
    constexpr int kBlocks[3][3] = {{0, 3, 5}, {1, 4, -1}, {2, -1, -1}};
    for (int i = 1; i <= n; ++i) {
      for (int back = 0; back < 3 && i - back >= 1; ++back) {
        std::fill(band.begin(), band.end(), 0.0);
        for (int ahead = 0; ahead + back < 3 && i + ahead <= n; ++ahead) {
          const double* h = lin.hessian.data() +
                            (static_cast<long>(i + ahead - 1) * 6 + kBlocks[back][ahead]) * dd;
          for (long k = 0; k < dd; ++k) band[k] += h[k];
        }
        for (const SplineWeight& wb : spline.weights(i - back).weights) {
          if (wb.node < 0) continue;
          times_weight(model, wb, band.data(), d, right.data());
          transpose(right.data(), d, right_t.data());
          for (const SplineWeight& wa : spline.weights(i).weights) {
            if (wa.node < 0) continue;
            times_weight(model, wa, right_t.data(), d, both.data());  // (half b) x (half a)
            const int a = dual_ + wa.half * d, b = dual_ + wb.half * d;
            // Off the frame diagonal the symmetric counterpart belongs to the matrix as well; put()
            // keeps what falls into the lower triangle.
            const bool a_first = wa.node > wb.node || (wa.node == wb.node && a >= b);
            if (back == 0 && !a_first) continue;
            if (wa.node == wb.node && a == b && back > 0) {
              put(wa.node, a, wb.node, b, d, d, both.data(), d, 1);
              put(wa.node, a, wb.node, b, d, d, both.data(), 1, d);
            } else if (a_first) {
              put(wa.node, a, wb.node, b, d, d, both.data(), 1, d);
            } else {
              put(wb.node, b, wa.node, a, d, d, both.data(), d, 1);
            }
          }
        }
      }
    }
  }
  add_constraints_spline(lin);
}

void KktSystem::add_constraints_spline(const Linearization& lin) {
  const Model& model = problem_.model();
  const HermiteSpline& spline = problem_.spline();
  const int d = model.ndof, m = dual_ / 2, n = problem_.frame_count();
  std::vector<double> block(static_cast<long>(m) * d);
  for (int i = 1; i <= n; ++i) {
    for (int back = 0; back < 3 && i - back >= 1; ++back) {
      const double* a = lin.jacobian.data() + (static_cast<long>(i - 1) * 3 + back) * m * d;
      for (const SplineWeight& trial : spline.weights(i - back).weights) {
        if (trial.node < 0) continue;
        times_weight(model, trial, a, m, block.data());
        for (const SplineWeight& test : spline.weights(i).weights) {
          if (test.node < 0 || test.value == 0) continue;
          const int row = test.half * m, column = dual_ + trial.half * d;
          if (test.node > trial.node) {
            put(test.node, row, trial.node, column, m, d, block.data(), d, 1, test.value);
          } else {  // multipliers stand first in a node: store the transpose
            put(trial.node, column, test.node, row, d, m, block.data(), 1, d, test.value);
          }
        }
      }
    }
  }
}

}  // namespace trajopt
