// Gauss-Newton Hessian of the objective rows in SIMD lanes: H_qp = sum J_q^T J_p over the window.
//
// Rows are stored without the columns they do not have: a foot's rows know the dofs between foot
// and root, and nothing of the other legs. Each element of H adds up its rows in one order, that of
// RowList, with fma; a column that is left out here and holds exact zeros in another pack (because
// one of its frames has more to say) changes nothing.
#pragma once

#include "trajopt/base/lanes.h"
#include "trajopt/base/products.h"
#include "trajopt/problem/row_list.h"

namespace trajopt::inline TRAJOPT_ISA {

// to[dofs[i]] += sum_r column[r, i] residual[r] for I neighbouring columns.
template <class S, int I>
TRAJOPT_HD inline void add_gradient(const RowSet<S>& s, const S* column, const int* dofs, S* to) {
  S sum[I];
  unrolled<I>([&](auto i) TRAJOPT_INLINE_BODY { sum[i] = to[dofs[i]]; });
  for (int r = 0; r < s.rows; ++r, column += s.columns) {
    const S residual = s.residual[r];
    unrolled<I>([&](auto i) TRAJOPT_INLINE_BODY { sum[i] = fma(column[i], residual, sum[i]); });
  }
  unrolled<I>([&](auto i) TRAJOPT_INLINE_BODY { to[dofs[i]] = sum[i]; });
}

// gradient (3 x d) = sum of J^T r.
template <class S>
TRAJOPT_HD inline void window_gradient(const RowList<S>& list, int d, S* gradient) {
  for (int i = 0; i < 3 * d; ++i) gradient[i] = S(0.0);
  for (int k = 0; k < list.count(); ++k) {
    const RowSet<S>& s = list[k];
    if (s.residual == nullptr) continue;
    for (int q = 0; q < s.nodes; ++q) {
      int i = 0;
      for (; i + 6 <= s.columns; i += 6)
        add_gradient<S, 6>(s, s.node(q) + i, s.dofs + i, gradient + q * d);
      for (; i + 3 <= s.columns; i += 3)
        add_gradient<S, 3>(s, s.node(q) + i, s.dofs + i, gradient + q * d);
      for (; i < s.columns; ++i) add_gradient<S, 1>(s, s.node(q) + i, s.dofs + i, gradient + q * d);
    }
  }
}

// Block (q, p), q <= p, of the Hessian, d x d; a diagonal block comes out whole. Sets about the
// same dofs that follow each other are multiplied in one go. panels: room for one a set.
template <class S>
TRAJOPT_HD inline void window_block(const RowList<S>& list, int q, int p, int d, Panel<S>* panels,
                                    S* h) {
  bool fresh = true;
  for (int k = 0; k < list.count();) {
    const RowSet<S>& first = list[k];
    int count = 0;
    for (; k < list.count() && list[k].same_dofs(first); ++k) {
      const RowSet<S>& s = list[k];
      if (s.nodes > p) panels[count++] = {s.node(q), s.node(p), s.rows};
    }
    if (count == 0) continue;
    if (fresh && first.columns < d)
      for (int i = 0; i < d * d; ++i) h[i] = S(0.0);
    add_products(panels, count, first.dofs, first.columns, fresh && first.columns == d, q == p, h,
                 d);
    fresh = false;
  }
  if (fresh)
    for (int i = 0; i < d * d; ++i) h[i] = S(0.0);
  if (q == p) {
    for (int r = 0; r < d; ++r)
      for (int c = r + 1; c < d; ++c) h[r * d + c] = h[c * d + r];
  }
}

}  // namespace trajopt::inline TRAJOPT_ISA
