// The KKT matrix of the spline formulation, gathered block row by block row.
//
// With W_i(n) the tangent of frame i by the halves of node n (SplineView), v_i(n) the scalar
// weights alone, K the frames' own Hessian, block-pentadiagonal, and J the Jacobian of their
// constraints, the matrix holds for nodes n and c
//
//   H(n, c) = sum_i [ sum_j W_j(n)^T K(j, i) ] W_i(c),    j = i - 2 .. i + 2,
//   A(n, c) = sum_i [ sum_j v_j(n)   J(j, i) ] W_i(c),    j = i .. i + 2.
//
// i ascends through the frames that reach block row g = (2g, 2g + 1), those of three segments and
// two before; the inner sum is formed once for every c. Blocks hold two nodes, and a node its
// multipliers (both halves) before its tangent (both halves): A(n, c) with n > c stands in the rows
// of n, with n <= c transposed in those of c.
#pragma once

#include <type_traits>

#include "trajopt/problem/kkt_rows.h"
#include "trajopt/trajectory/hermite_body.h"

namespace trajopt {

struct SplineRows {
  SplineView spline;
  int dofs, constraints;   // D and m of a frame
  double damping;          // added to the diagonal of H
  const double* hessian;   // N x 6 x D x D windows; nullptr: without H
  const double* jacobian;  // N x 3 x m x D
  double* diagonal;        // blocks x size x size
  double* lower;           // blocks - 1 of them

  TRAJOPT_HD int width() const { return 2 * (dofs + constraints); }
  TRAJOPT_HD int size() const { return 2 * width(); }
  TRAJOPT_HD long frames() const { return static_cast<long>(spline.segments) * spline.per_segment; }
  TRAJOPT_HD long segment(long frame) const { return frame / spline.per_segment; }
  // Where entry (row, column) of the nodes' block is stored; column_node <= row_node.
  TRAJOPT_HD double* entry(long row_node, int row, long column_node, int column) const {
    const long g = row_node / 2, square = static_cast<long>(size()) * size();
    double* block = column_node / 2 == g ? diagonal + g * square : lower + (g - 1) * square;
    return block + (row_node % 2 * width() + row) * size() + column_node % 2 * width() + column;
  }
};

inline namespace TRAJOPT_ISA {

// Doubles a group needs beside its output: four blocks of K and an inner sum.
TRAJOPT_HD constexpr long spline_row_scratch(long dofs) { return 5 * dofs * dofs; }

// What an inner sum adds up: blocks by the rows of frame j, weighted with one of its halves.
struct SplineTerms {
  struct Term {
    const double* block;
    long frame;
    int half;
  } term[5];
  int count = 0;

  // Adds the block of `frame` if the frame is one of the node's.
  TRAJOPT_HD void add(const SplineRows& k, const double* block, long frame, long node, int half) {
    const long s = k.segment(frame);
    if (s == node || s == node + 1) term[count++] = {block, frame, (s == node ? 2 : 0) + half};
  }
};

// body(std::integral_constant<int, count>), so that chains of so many terms stay in registers.
template <class Body>
TRAJOPT_HD inline void with_count(int count, const Body& body) {
  switch (count) {
    case 1:
      return body(std::integral_constant<int, 1>());
    case 2:
      return body(std::integral_constant<int, 2>());
    case 3:
      return body(std::integral_constant<int, 3>());
    case 4:
      return body(std::integral_constant<int, 4>());
    default:
      return body(std::integral_constant<int, 5>());
  }
}

// Rows [first, first + rows) of out = sum of v_j times block j.
template <int Count, class Group>
TRAJOPT_HD inline void sum_plain(const Group& group, const SplineRows& k, const SplineTerms& terms,
                                 int first, int rows, double* out) {
  const int d = k.dofs;
  const long offset = static_cast<long>(first) * d;
  const double* block[Count];
  double w[Count];
  for (int t = 0; t < Count; ++t) {
    block[t] = terms.term[t].block + offset;
    w[t] = k.spline.weight(terms.term[t].frame, terms.term[t].half);
  }
  out += offset;
  for_entries(group, rows, d, [&](int r, int c) {
    double sum = w[0] * block[0][r * d + c];
    TRAJOPT_UNROLL
    for (int t = 1; t < Count; ++t) sum = fma(w[t], block[t][r * d + c], sum);
    out[r * d + c] = sum;
  });
}

// The three rows of a ball of out = sum of W_j^T times block j.
template <int Count, class Group>
TRAJOPT_HD inline void sum_ball(const Group& group, const SplineRows& k, const SplineTerms& terms,
                                const DofRun& dofs, double* out) {
  const int d = k.dofs;
  const long offset = static_cast<long>(dofs.first) * d;
  const double *block[Count], *w[Count];
  for (int t = 0; t < Count; ++t) {
    block[t] = terms.term[t].block + offset;
    w[t] = k.spline.rotation(terms.term[t].frame, terms.term[t].half, dofs.ball);
  }
  out += offset;
  for_entries(group, 3, d, [&](int r, int c) {
    double sum = 0.0;
    TRAJOPT_UNROLL
    for (int t = 0; t < Count; ++t) {
      TRAJOPT_UNROLL
      for (int b = 0; b < 3; ++b) sum = fma(w[t][3 * b + r], block[t][b * d + c], sum);
    }
    out[r * d + c] = sum;
  });
}

// out (D x D) = sum of W_j^T K(j, i).
template <class Group>
TRAJOPT_HD inline void sum_hessian(const Group& group, const SplineRows& k,
                                   const SplineTerms& terms, double* out) {
  with_count(terms.count, [&](auto count) {
    for (int run = 0; run < k.spline.nruns; ++run) {
      const DofRun& dofs = k.spline.runs[run];
      if (dofs.ball >= 0) {
        sum_ball<count()>(group, k, terms, dofs, out);
      } else {
        sum_plain<count()>(group, k, terms, dofs.first, dofs.count, out);
      }
    }
  });
}

// to (rows x D, or its transpose) += in (rows x D) times W_i, the tangent of frame i by `half`.
template <bool Transposed, class Group>
TRAJOPT_HD inline void add_product(const Group& group, const SplineRows& k, int rows,
                                   const double* in, long i, int half, double* to) {
  const int d = k.dofs;
  const long ld = k.size();
  // Columns [first, first + count) of the product; body(value, row, column).
  const auto update = [&](int first, int count, const auto& body) {
    const double* from = in + first;
    if constexpr (Transposed) {
      double* target = to + first * ld;
      for_entries(group, count, rows,
                  [&](int c, int r) { body(target[c * ld + r], from + r * d, c); });
    } else {
      double* target = to + first;
      for_entries(group, rows, count,
                  [&](int r, int c) { body(target[r * ld + c], from + r * d, c); });
    }
  };
  // A ball's columns by nothing first, so that all of a row is one loop.
  const double* plain = k.spline.plain_weights(i, half, d);
  update(0, d,
         [&](double& value, const double* row, int c) { value = fma(plain[c], row[c], value); });
  for (int run = 0; run < k.spline.nruns; ++run) {
    const DofRun& dofs = k.spline.runs[run];
    if (dofs.ball < 0) continue;
    const double* w = k.spline.rotation(i, half, dofs.ball);
    update(dofs.first, 3, [&](double& value, const double* row, int c) {
      double sum = value;
      TRAJOPT_UNROLL
      for (int b = 0; b < 3; ++b) sum = fma(row[b], w[3 * b + c], sum);
      value = sum;
    });
  }
}

// K(i + ahead, i), ahead = -2 .. 2 at [ahead + 2]; nullptr beyond the ends. Sums of the windows
// that see both frames, above the diagonal transposed.
template <class Group>
TRAJOPT_HD inline void write_band(const Group& group, const SplineRows& k, long i, double* scratch,
                                  const double* band[5]) {
  const int d = k.dofs;
  const long n = k.frames(), dd = static_cast<long>(d) * d;
  const auto window = [&](long f, int block) -> const double* {
    return f < n ? k.hessian + (f * 6 + block) * dd : nullptr;
  };
  const auto sum = [&](int at, bool transposed, const double* a, const double* b, const double* c) {
    double* out = scratch + at * dd;
    const auto write = [&](const auto& value) {
      if (transposed) {
        for_entries(group, d, d, [&](int r, int s) { out[r * d + s] = value(s * d + r); });
      } else {
        for_entries(group, d, d, [&](int r, int s) { out[r * d + s] = value(r * d + s); });
      }
    };
    if (c != nullptr) {
      write([&](int e) { return a[e] + b[e] + c[e]; });
    } else if (b != nullptr) {
      write([&](int e) { return a[e] + b[e]; });
    } else {
      write([&](int e) { return a[e]; });
    }
    band[at] = out;
  };
  for (int b = 0; b < 5; ++b) band[b] = nullptr;
  if (i >= 2) sum(0, true, window(i, 2), nullptr, nullptr);
  if (i >= 1) sum(1, true, window(i, 1), window(i + 1, 4), nullptr);
  sum(2, false, window(i, 0), window(i + 1, 3), window(i + 2, 5));
  if (i + 1 < n) sum(3, false, window(i + 1, 1), window(i + 2, 4), nullptr);
  band[4] = window(i + 2, 2);
}

// What frame i adds to H.
template <class Group>
TRAJOPT_HD inline void add_frame_hessian(const Group& group, const SplineRows& k, long g, long i,
                                         double* scratch) {
  const int d = k.dofs, tangent = 2 * k.constraints;
  const long s = k.segment(i);
  const double* band[5];
  write_band(group, k, i, scratch, band);
  double* inner = scratch + 4L * d * d;
  for (long n = 2 * g; n < 2 * g + 2 && n < k.spline.segments; ++n) {
    for (int half = 0; half < 2; ++half) {
      SplineTerms terms;
      for (int ahead = -2; ahead <= 2; ++ahead)
        if (band[ahead + 2] != nullptr) terms.add(k, band[ahead + 2], i + ahead, n, half);
      if (terms.count == 0) continue;
      sum_hessian(group, k, terms, inner);
      for (long c = s > 0 ? s - 1 : 0; c <= s && c <= n; ++c) {
        for (int h = 0; h <= (c == n ? half : 1); ++h) {
          add_product<false>(group, k, d, inner, i, (s == c ? 2 : 0) + h,
                             k.entry(n, tangent + half * d, c, tangent + h * d));
        }
      }
    }
  }
}

// What frame i adds to A and to its transpose.
template <class Group>
TRAJOPT_HD inline void add_frame_constraints(const Group& group, const SplineRows& k, long g,
                                             long i, double* inner) {
  const int d = k.dofs, m = k.constraints;
  const long s = k.segment(i);
  for (long n = s > 0 ? s - 1 : 0; n <= s + 1 && n < k.spline.segments; ++n) {
    // Rows y_n with n > c, or x_c with n <= c: are any of them here?
    if ((n > s ? n : s) / 2 != g && (n > s - 1 ? n : s - 1) / 2 != g) continue;
    for (int half = 0; half < 2; ++half) {
      SplineTerms terms;
      for (int ahead = 0; ahead <= 2 && i + ahead < k.frames(); ++ahead)
        terms.add(k, k.jacobian + ((i + ahead) * 3 + ahead) * m * d, i + ahead, n, half);
      if (terms.count == 0) continue;
      with_count(terms.count,
                 [&](auto count) { sum_plain<count()>(group, k, terms, 0, m, inner); });
      for (long c = s > 0 ? s - 1 : 0; c <= s; ++c) {
        if ((n > c ? n : c) / 2 != g) continue;
        for (int h = 0; h < 2; ++h) {
          const int x = 2 * m + h * d, y = half * m, of_c = (s == c ? 2 : 0) + h;
          if (n > c) {
            add_product<false>(group, k, m, inner, i, of_c, k.entry(n, y, c, x));
          } else {
            add_product<true>(group, k, m, inner, i, of_c, k.entry(c, x, n, y));
          }
        }
      }
    }
  }
}

// Block row g, all of it: what pads an odd count of nodes is the identity.
template <class Group>
TRAJOPT_HD inline void write_spline_block_row(const Group& group, const SplineRows& k, long g,
                                              double* scratch) {
  const int size = k.size(), width = k.width();
  const long square = static_cast<long>(size) * size;
  double* diagonal = k.diagonal + g * square;
  for_entries(group, size, size, [&](int r, int c) { diagonal[r * size + c] = 0.0; });
  for_each(group, size, [&](int r) {
    const bool padding = 2 * g + r / width >= k.spline.segments;
    if (padding || r % width >= 2 * k.constraints)
      diagonal[static_cast<long>(r) * size + r] = padding ? 1.0 : k.damping;
  });
  if (g > 0) {
    double* lower = k.lower + (g - 1) * square;
    for_entries(group, size, size, [&](int r, int c) { lower[r * size + c] = 0.0; });
  }
  const long first = 2 * g * k.spline.per_segment, last = first + 3L * k.spline.per_segment;
  for (long i = first > 1 ? first - 2 : 0; i < last && i < k.frames(); ++i) {
    if (k.hessian != nullptr) add_frame_hessian(group, k, g, i, scratch);
    add_frame_constraints(group, k, g, i, scratch);
  }
}

}  // namespace TRAJOPT_ISA
}  // namespace trajopt
