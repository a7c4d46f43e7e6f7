// The KKT matrix of the frames formulation, written block row by block row.
//
// Blocks hold two nodes; within a node the multipliers come first. For the nodes a = 2g, b = 2g + 1
// of block row g, whose constraints reach two nodes back (A_ab: constraint a by node b):
//
//   lower(g - 1)  columns of a-2, a-1       diagonal(g)  columns of a, b (lower triangle)
//   y_a     .  A_aa-2    .  A_aa-1          .
//   x_a     .  H_aa-2    .  H_aa-1          A_aa^T  H_aa
//   y_b     .  .         .  A_ba-1          .       A_ba   .
//   x_b     .  .         .  H_ba-1          .       H_ba   A_bb^T  H_bb
//
// Only the entries shown are written: the zeros are there from the beginning.
#pragma once

#include "trajopt/base/group.h"
#include "trajopt/base/pack.h"

// The iterations of the loop behind it touch different memory, which a compiler cannot prove.
#if defined(__GNUC__) && !defined(__CUDACC__) && !defined(__clang__)
#define TRAJOPT_INDEPENDENT _Pragma("GCC ivdep")
#else
#define TRAJOPT_INDEPENDENT
#endif

namespace trajopt {

struct KktRows {
  int nodes, primal, dual;
  double smoothing, damping;
  const double* hessian;   // N x 6 x D x D windows; nullptr: without H
  const double* jacobian;  // N x 3 x m x D
  double* diagonal;        // blocks x size x size
  double* lower;           // blocks - 1 of them
};

inline namespace TRAJOPT_ISA {

// W's weights of node i with nodes i, i-1, i-2. Row f of D2 is x_f - 2 x_{f-1} + x_{f-2}, and what
// lies before node 0 is fixed; in a ring nothing ends.
TRAJOPT_HD inline void metric_weights(double smoothing, int node, int nodes, bool ring,
                                      double* weights) {
  const bool next = ring || node + 1 < nodes, after = ring || node + 2 < nodes;
  weights[0] = 1 + smoothing * (1 + (next ? 4 : 0) + (after ? 1 : 0));
  weights[1] = smoothing * (-2 - (next ? 2 : 0));
  weights[2] = smoothing;
}

// body(row, column), dealt out so that neighbouring ranks take neighbouring columns.
template <class Group, class Body>
TRAJOPT_HD inline void for_entries(const Group& group, int rows, int columns, const Body& body) {
  if (group.size() == 1) {
    group.phase([&](int) {
      for (int r = 0; r < rows; ++r) {
        TRAJOPT_INDEPENDENT
        for (int c = 0; c < columns; ++c) body(r, c);
      }
    });
  } else {
    for_each(group, rows * columns, [&](int i) { body(i / columns, i % columns); });
  }
}

// target (ld) = H of nodes (i, i - back) + damping W: the windows of the frames that see both.
template <class Group>
TRAJOPT_HD inline void write_hessian(const Group& group, const KktRows& k, int i, int back,
                                     double* target, long ld) {
  constexpr int kBlocks[3][3] = {{0, 3, 5}, {1, 4, -1}, {2, -1, -1}};
  const int d = k.primal;
  const long dd = static_cast<long>(d) * d;
  double w[3];
  metric_weights(k.smoothing, i, k.nodes, false, w);
  const double one = k.damping * w[back];
  int frames = k.hessian == nullptr ? 0 : 3 - back;
  if (frames > k.nodes - i) frames = k.nodes - i;
  const double* h[3];
  for (int ahead = 0; ahead < frames; ++ahead)
    h[ahead] = k.hessian + ((i + ahead) * 6L + kBlocks[back][ahead]) * dd;
  const auto write = [&](const auto& sum) {
    for_entries(group, d, d, [&](int r, int c) { target[r * ld + c] = sum(r * d + c); });
  };
  switch (frames) {
    case 3:
      write([&](int e) { return h[0][e] + h[1][e] + h[2][e]; });
      break;
    case 2:
      write([&](int e) { return h[0][e] + h[1][e]; });
      break;
    case 1:
      write([&](int e) { return h[0][e]; });
      break;
    default:
      write([](int) { return 0.0; });
  }
  for_each(group, d, [&](int r) { target[r * ld + r] += one; });
}

// target (ld) = A of constraint i by node i - back; transposed when back is 0.
template <class Group>
TRAJOPT_HD inline void write_constraint(const Group& group, const KktRows& k, int i, int back,
                                        double* target, long ld) {
  const int d = k.primal, m = k.dual;
  const double* a = k.jacobian + (i * 3L + back) * m * d;
  if (back == 0) {
    for_entries(group, d, m, [&](int r, int c) { target[r * ld + c] = a[c * d + r]; });
  } else {
    for_entries(group, m, d, [&](int r, int c) { target[r * ld + c] = a[r * d + c]; });
  }
}

template <class Group>
TRAJOPT_HD inline void write_block_row(const Group& group, const KktRows& k, long g) {
  const int m = k.dual, width = k.primal + k.dual, size = 2 * width;
  const long square = static_cast<long>(size) * size;
  double* diagonal = k.diagonal + g * square;
  double* lower = g > 0 ? k.lower + (g - 1) * square : nullptr;
  for (int half = 0; half < 2; ++half) {
    const int i = static_cast<int>(2 * g) + half, row = half * width;
    if (i >= k.nodes) break;
    for (int back = 0; back < 3; ++back) {
      const int column = half - back;  // node of this block, or counted back from it
      double* to = column >= 0 ? diagonal : lower;
      if (to == nullptr) break;
      to += (column + (column >= 0 ? 0 : 2)) * width;
      if (back == 0) {
        write_constraint(group, k, i, back, to + static_cast<long>(row + m) * size, size);
      } else {
        write_constraint(group, k, i, back, to + static_cast<long>(row) * size + m, size);
      }
      write_hessian(group, k, i, back, to + static_cast<long>(row + m) * size + m, size);
    }
  }
}

}  // namespace TRAJOPT_ISA
}  // namespace trajopt
