// The KKT matrix of the spline formulation, gathered block row by block row.
//
// With W_i the frame's tangent by the halves of its control points (SplineView), K the frames' own
// Hessian, block-pentadiagonal, and J the Jacobian of their constraints, the matrix holds for nodes
// n and c
//
//   H(n, c) = sum_i W_i(n)^T sum_j K(i, j) W_j(c),    j = i - 2 .. i + 2,
//   A(n, c) = sum_i v_i(n) sum_j J(i, j) W_j(c),      j = i - 2 .. i,    v: the scalar weights.
//
// Frame i is a frame of two nodes, so block row g = (2g, 2g + 1) gathers from the frames of three
// segments, in ascending order; the inner sum is projected once and used by every row. Blocks hold
// two nodes, and a node its multipliers (both halves) before its tangent (both halves):
// A(n, c) with n > c stands in the rows of n, with n <= c transposed in those of c.
#pragma once

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

// Doubles a group needs beside its output: four blocks of K and a projection.
TRAJOPT_HD constexpr long spline_row_scratch(long dofs) { return 5 * dofs * dofs; }

// What a projection sums: block (rows x D) times the tangent of a frame by one of its halves.
struct SplineTerm {
  const double* block;
  long frame;
  int half;
};

struct SplineTerms {
  SplineTerm term[5];
  int count = 0;

  // K(i, j) or J(i, j) with j = `frame` adds to a projection onto (node, half), or does not.
  TRAJOPT_HD void add(const SplineRows& k, const double* block, long frame, long node, int half) {
    const long s = k.segment(frame);
    if (s == node || s == node + 1) term[count++] = {block, frame, (s == node ? 2 : 0) + half};
  }
};

template <int Count, class Group>
TRAJOPT_HD inline void project_plain(const Group& group, const SplineRows& k, int rows,
                                     const SplineTerms& terms, int first, int columns, double* out) {
  const double* block[Count];
  double w[Count];
  TRAJOPT_UNROLL
  for (int t = 0; t < Count; ++t) {
    block[t] = terms.term[t].block + first;
    w[t] = k.spline.weight(terms.term[t].frame, terms.term[t].half);
  }
  const int d = k.dofs;
  out += first;
  for_entries(group, rows, columns, [&](int r, int c) {
    double sum = w[0] * block[0][r * d + c];
    TRAJOPT_UNROLL
    for (int t = 1; t < Count; ++t) sum = fma(w[t], block[t][r * d + c], sum);
    out[r * d + c] = sum;
  });
}

template <class Group>
TRAJOPT_HD inline void project_ball(const Group& group, const SplineRows& k, int rows,
                                    const SplineTerms& terms, const DofRun& dofs, double* out) {
  const int d = k.dofs;
  for_entries(group, rows, 3, [&](int r, int c) {
    const long at = r * d + dofs.first;
    double sum = 0.0;
    for (int t = 0; t < terms.count; ++t) {
      const double* block = terms.term[t].block + at;
      const double* w = k.spline.rotation(terms.term[t].frame, terms.term[t].half, dofs.ball);
      for (int b = 0; b < 3; ++b) sum = fma(block[b], w[3 * b + c], sum);
    }
    out[at + c] = sum;
  });
}

// out (rows x D) = the sum of the terms.
template <class Group>
TRAJOPT_HD inline void project(const Group& group, const SplineRows& k, int rows,
                               const SplineTerms& terms, double* out) {
  for (int run = 0; run < k.spline.nruns; ++run) {
    const DofRun& dofs = k.spline.runs[run];
    if (dofs.ball >= 0) {
      project_ball(group, k, rows, terms, dofs, out);
      continue;
    }
    switch (terms.count) {
      case 1:
        project_plain<1>(group, k, rows, terms, dofs.first, dofs.count, out);
        break;
      case 2:
        project_plain<2>(group, k, rows, terms, dofs.first, dofs.count, out);
        break;
      case 3:
        project_plain<3>(group, k, rows, terms, dofs.first, dofs.count, out);
        break;
      case 4:
        project_plain<4>(group, k, rows, terms, dofs.first, dofs.count, out);
        break;
      default:
        project_plain<5>(group, k, rows, terms, dofs.first, dofs.count, out);
    }
  }
}

// target (ld) += W^T in, W the tangent of frame i by one of its halves; in: D x D.
template <class Group>
TRAJOPT_HD inline void add_projected(const Group& group, const SplineRows& k, long i, int half,
                                     const double* in, double* target) {
  const int d = k.dofs;
  const long ld = k.size();
  for (int run = 0; run < k.spline.nruns; ++run) {
    const DofRun& dofs = k.spline.runs[run];
    const double* from = in + static_cast<long>(dofs.first) * d;
    double* to = target + dofs.first * ld;
    if (dofs.ball < 0) {
      const double w = k.spline.weight(i, half);
      for_entries(group, dofs.count, d,
                  [&](int r, int c) { to[r * ld + c] = fma(w, from[r * d + c], to[r * ld + c]); });
      continue;
    }
    const double* w = k.spline.rotation(i, half, dofs.ball);
    for_entries(group, 3, d, [&](int r, int c) {
      double sum = to[r * ld + c];
      TRAJOPT_UNROLL
      for (int b = 0; b < 3; ++b) sum = fma(w[3 * b + r], from[b * d + c], sum);
      to[r * ld + c] = sum;
    });
  }
}

// Blocks K(i, i + ahead) of the frames' Hessian, ahead = -2 .. 2 at [ahead + 2]; nullptr beyond the
// ends. Sums of the windows that see both frames; above the diagonal transposed.
template <class Group>
TRAJOPT_HD inline void write_band(const Group& group, const SplineRows& k, long i, double* scratch,
                                  const double* band[5]) {
  const long n = k.frames(), dd = static_cast<long>(k.dofs) * k.dofs;
  const int d = k.dofs;
  // Block b of window f; the frames at hand see windows i .. i + 2.
  const auto window = [&](long f, int b) -> const double* {
    return f < n ? k.hessian + (f * 6 + b) * dd : nullptr;
  };
  for (int b = 0; b < 5; ++b) band[b] = nullptr;
  if (i >= 2) band[0] = window(i, 2);
  const auto sum = [&](int at, bool transposed, const double* a, const double* b,
                       const double* c) {
    double* out = scratch + (at - 1) * dd;
    band[at] = out;
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
  };
  if (i >= 1) sum(1, false, window(i, 1), window(i + 1, 4), nullptr);
  sum(2, false, window(i, 0), window(i + 1, 3), window(i + 2, 5));
  if (i + 1 < n) sum(3, true, window(i + 1, 1), window(i + 2, 4), nullptr);
  if (i + 2 < n) sum(4, true, window(i + 2, 2), nullptr, nullptr);
}

// The rows' share of H that comes with frame i.
template <class Group>
TRAJOPT_HD inline void add_frame_hessian(const Group& group, const SplineRows& k, long g, long i,
                                         double* scratch) {
  const long n = k.frames(), dd = static_cast<long>(k.dofs) * k.dofs, s = k.segment(i);
  const double* band[5];
  write_band(group, k, i, scratch, band);
  double* projected = scratch + 4 * dd;
  const long last = s < 2 * g + 1 ? s : 2 * g + 1;  // of the rows' nodes
  const long first = s - 1 > 2 * g ? s - 1 : 2 * g;
  for (long c = s - 2 > 0 ? s - 2 : 0; c <= last; ++c) {
    for (int half = 0; half < 2; ++half) {
      SplineTerms terms;
      for (int ahead = -2; ahead <= 2; ++ahead)
        if (i + ahead >= 0 && i + ahead < n) terms.add(k, band[ahead + 2], i + ahead, c, half);
      if (terms.count == 0) continue;
      project(group, k, k.dofs, terms, projected);
      const int column = 2 * k.constraints + half * k.dofs;
      for (long row = c > first ? c : first; row <= last; ++row) {
        for (int h = row == c ? half : 0; h < 2; ++h) {
          add_projected(group, k, i, (s == row ? 2 : 0) + h, projected,
                        k.entry(row, 2 * k.constraints + h * k.dofs, c, column));
        }
      }
    }
  }
}

// The rows' share of A and its transpose that comes with the constraints of frame i.
template <class Group>
TRAJOPT_HD inline void add_frame_constraints(const Group& group, const SplineRows& k, long g,
                                             long i, double* projected) {
  const int d = k.dofs, m = k.constraints;
  const long ld = k.size(), s = k.segment(i);
  for (long c = s - 2 > 0 ? s - 2 : 0; c <= s; ++c) {
    for (int half = 0; half < 2; ++half) {
      SplineTerms terms;
      for (int back = 2; back >= 0; --back)
        if (i >= back) terms.add(k, k.jacobian + (i * 3 + back) * m * d, i - back, c, half);
      if (terms.count == 0) continue;
      project(group, k, m, terms, projected);
      const int x = 2 * m + half * d;
      for (long n = s > 0 ? s - 1 : 0; n <= s; ++n) {
        const long row_node = n > c ? n : c;
        if (row_node / 2 != g) continue;
        for (int h = 0; h < 2; ++h) {
          const double v = k.spline.weight(i, (s == n ? 2 : 0) + h);
          if (n > c) {
            double* to = k.entry(n, h * m, c, x);
            for_entries(group, m, d, [&](int r, int j) {
              to[r * ld + j] = fma(v, projected[r * d + j], to[r * ld + j]);
            });
          } else {
            double* to = k.entry(c, x, n, h * m);
            for_entries(group, d, m, [&](int r, int j) {
              to[r * ld + j] = fma(v, projected[j * d + r], to[r * ld + j]);
            });
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
  const long begin = 2 * g * k.spline.per_segment, most = begin + 3L * k.spline.per_segment;
  const long end = most < k.frames() ? most : k.frames();
  for (long i = begin; i < end; ++i) {
    if (k.hessian != nullptr) add_frame_hessian(group, k, g, i, scratch);
    add_frame_constraints(group, k, g, i, scratch);
  }
}

}  // namespace TRAJOPT_ISA
}  // namespace trajopt
