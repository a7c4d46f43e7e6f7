// Gauss-Newton Hessian of the objective rows in SIMD lanes: H_qp = sum J_q^T J_p over the window.
//
// Rows that reach the same dofs make a group and are stored without the columns they do not have:
// a foot's rows know the dofs between foot and root, and nothing of the other legs. Groups
// contribute in their order, rows of a group in theirs, with fma; a column that is left out where
// another pack would hold exact zeros changes nothing.
#pragma once

#include "trajopt/base/lanes.h"
#include "trajopt/base/products.h"
#include "trajopt/problem/frame_kernels.h"

namespace trajopt::inline TRAJOPT_ISA {

template <class S>
struct RowGroup {
  int rows;
  int nodes;          // the rows depend on nodes 0 .. nodes - 1
  int columns;        // per node
  const int* dofs;    // of the columns, ascending
  const S* jacobian;  // rows x nodes x columns
  const S* residual;  // rows; null: not part of the gradient
};

// gradient (3 x d) = sum of J^T r.
template <class S>
TRAJOPT_HD inline void window_gradient(const RowGroup<S>* groups, int count, int d, S* gradient) {
  for (int i = 0; i < 3 * d; ++i) gradient[i] = S(0.0);
  for (int k = 0; k < count; ++k) {
    const RowGroup<S>& g = groups[k];
    if (g.residual == nullptr) continue;
    const int stride = g.nodes * g.columns;
    for (int q = 0; q < g.nodes; ++q) {
      for (int i = 0; i < g.columns; ++i) {
        S& to = gradient[q * d + g.dofs[i]];
        S sum = to;
        for (int r = 0; r < g.rows; ++r)
          sum = fma(g.jacobian[r * stride + q * g.columns + i], g.residual[r], sum);
        to = sum;
      }
    }
  }
}

// Block (q, p) of the Hessian, d x d; a diagonal block comes out whole.
template <class S>
TRAJOPT_HD inline void window_block(const RowGroup<S>* groups, int count, int q, int p, int d,
                                    S* h) {
  const int needed = (q > p ? q : p) + 1;
  int k = 0;
  while (k < count && groups[k].nodes < needed) ++k;
  bool fresh = k < count && groups[k].columns == d;  // the first group writes every element
  if (!fresh)
    for (int i = 0; i < d * d; ++i) h[i] = S(0.0);
  for (; k < count; ++k) {
    const RowGroup<S>& g = groups[k];
    if (g.nodes < needed) continue;
    const int stride = g.nodes * g.columns;
    const Panel<S> a{g.jacobian + q * g.columns, stride, g.dofs, g.columns};
    const Panel<S> b{g.jacobian + p * g.columns, stride, g.dofs, g.columns};
    add_products(g.rows, a, b, fresh, q == p, h, d);
    fresh = false;
  }
  if (q == p) {
    for (int r = 0; r < d; ++r)
      for (int c = r + 1; c < d; ++c) h[r * d + c] = h[c * d + r];
  }
}

}  // namespace trajopt::inline TRAJOPT_ISA
