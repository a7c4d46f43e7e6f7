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
// In a ring the last block row is the border of the others: its diagonal is the corner, and what
// couples it to its neighbours stands in the border, which has a row for every row of the chain:
//
//   border(0)  =  what would be lower(-1)        border(last - 1)  =  the transpose of lower(last -
//   1)
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
  bool ring;
  double smoothing, damping;
  const double* hessian;   // N x 6 x D x D windows; nullptr: without H
  const double* jacobian;  // N x 3 x m x D
  double* diagonal;        // of the chain's blocks, size x size each
  double* lower;           // one block less
  double* border;          // of a ring: chain's blocks x size x size
  double* corner;          // size x size
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

// A part of a block whose elements (r, c) are wanted, or of its transpose.
template <bool Transposed>
struct BlockPart {
  double* at;
  long ld;

  TRAJOPT_HD double& operator()(long r, long c) const {
    return Transposed ? at[c * ld + r] : at[r * ld + c];
  }
  TRAJOPT_HD BlockPart from(long r, long c) const { return {&(*this)(r, c), ld}; }
};

// target = H of nodes (i, i - back) + damping W: the windows of the frames that see both.
template <class Group, class Target>
TRAJOPT_HD inline void write_hessian(const Group& group, const KktRows& k, int i, int back,
                                     const Target& target) {
  constexpr int kBlocks[3][3] = {{0, 3, 5}, {1, 4, -1}, {2, -1, -1}};
  const int d = k.primal;
  const long dd = static_cast<long>(d) * d;
  double w[3];
  metric_weights(k.smoothing, i, k.nodes, k.ring, w);
  const double one = k.damping * w[back];
  int frames = k.hessian == nullptr ? 0 : 3 - back;
  if (!k.ring && frames > k.nodes - i) frames = k.nodes - i;
  const double* h[3];
  for (int ahead = 0; ahead < frames; ++ahead) {
    const long f = i + ahead < k.nodes ? i + ahead : i + ahead - k.nodes;
    h[ahead] = k.hessian + (f * 6 + kBlocks[back][ahead]) * dd;
  }
  const auto write = [&](const auto& sum) {
    for_entries(group, d, d, [&](int r, int c) { target(r, c) = sum(r * d + c); });
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
  for_each(group, d, [&](int r) { target(r, r) += one; });
}

// target = A of constraint i by node i - back; transposed when back is 0.
template <class Group, class Target>
TRAJOPT_HD inline void write_constraint(const Group& group, const KktRows& k, int i, int back,
                                        const Target& target) {
  const int d = k.primal, m = k.dual;
  const double* a = k.jacobian + (i * 3L + back) * m * d;
  if (back == 0) {
    for_entries(group, d, m, [&](int r, int c) { target(r, c) = a[c * d + r]; });
  } else {
    for_entries(group, m, d, [&](int r, int c) { target(r, c) = a[r * d + c]; });
  }
}

// What couples node i to node i - back; target begins with the row of the one and the column of the
// other.
template <class Group, class Target>
TRAJOPT_HD inline void write_coupling(const Group& group, const KktRows& k, int i, int back,
                                      const Target& target) {
  write_constraint(group, k, i, back, back == 0 ? target.from(k.dual, 0) : target.from(0, k.dual));
  write_hessian(group, k, i, back, target.from(k.dual, k.dual));
}

template <class Group>
TRAJOPT_HD inline void write_block_row(const Group& group, const KktRows& k, long g) {
  const int width = k.primal + k.dual, size = 2 * width;
  const long square = static_cast<long>(size) * size;
  const bool closing = k.ring && 2 * g + 2 == k.nodes;  // the row that is the border
  double* diagonal = closing ? k.corner : k.diagonal + g * square;
  double* before = g > 0 ? k.lower + (g - 1) * square : k.border;
  if (closing) before = k.border + (g - 1) * square;
  for (int half = 0; half < 2; ++half) {
    const int i = static_cast<int>(2 * g) + half, row = half * width;
    if (i >= k.nodes) break;
    for (int back = 0; back < 3; ++back) {
      const int column = half - back;  // node of this block, or counted back from it
      if (column >= 0) {
        write_coupling(group, k, i, back,
                       BlockPart<false>{diagonal, size}.from(row, column * width));
      } else if (before == nullptr) {
        break;
      } else if (closing) {
        write_coupling(group, k, i, back,
                       BlockPart<true>{before, size}.from(row, (column + 2) * width));
      } else {
        write_coupling(group, k, i, back,
                       BlockPart<false>{before, size}.from(row, (column + 2) * width));
      }
    }
  }
}

}  // namespace TRAJOPT_ISA
}  // namespace trajopt
