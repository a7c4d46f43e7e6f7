// A frame's linearization in the hands of a group: one rank finds the rows (frame_body.h), all of
// them multiply. Entries of the Hessian are divided among the ranks, never the terms of one, which
// are added up in the order of gram.h: so the bits are the same.
#pragma once

#include "trajopt/base/group.h"
#include "trajopt/problem/frame_body.h"

namespace trajopt::inline TRAJOPT_ISA {

// What the rank that finds a frame's rows leaves for the others, ahead of its scratch memory.
struct FrameRows {
  static constexpr std::size_t kBytes = 64;
  const RowSet<double>* sets;
  int count;
};

TRAJOPT_HD inline std::size_t group_scratch_bytes(const FrameInput& in) {
  return FrameRows::kBytes + frame_scratch_bytes<double>(in);
}

TRAJOPT_HD inline FrameScratch<double> frame_scratch(const FrameInput& in, unsigned char* memory) {
  return FrameScratch<double>(in, memory + FrameRows::kBytes);
}

// To be called by one rank.
template <bool Derivatives>
TRAJOPT_HD inline void find_rows(const FrameInput& in, long frame, unsigned char* memory,
                                 const FrameOutput& out) {
  const FrameScratch<double> s = frame_scratch(in, memory);
  const RowList<double> rows = frame_rows<double, Derivatives>(in, frame, 1, s, out);
  *reinterpret_cast<FrameRows*>(memory) = {rows.sets(), rows.count()};
}

// H_qp += J_q^T J_p of one set of rows, all blocks of the window: hessian, 6 x d x d.
template <class Group>
TRAJOPT_HD inline void add_set(const Group& group, const RowSet<double>& s, int d,
                               double* hessian) {
  const int n = s.columns;
  for_each(group, 6 * n * n, [&](int k) {
    const int b = k / (n * n), i = k / n % n, j = k % n;
    const int q = kWindowBlocks[b][0], p = kWindowBlocks[b][1];
    if (p >= s.nodes) return;
    double* entry = hessian + (b * d + s.dofs[i]) * d + s.dofs[j];
    const double *x = s.node(q) + i, *y = s.node(p) + j;
    double sum = *entry;
    for (int r = 0; r < s.rows; ++r, x += n, y += n) sum = fma(*x, *y, sum);
    *entry = sum;
  });
}

// After find_rows<true>() and a barrier: the frame's Hessian and Jacobians.
template <class Group>
TRAJOPT_HD inline void multiply_rows(const Group& group, const FrameInput& in, long frame,
                                     unsigned char* memory, const FrameOutput& out) {
  const int d = in.model.ndof, m = in.model.nunactuated;
  const FrameScratch<double> s = frame_scratch(in, memory);
  const FrameRows& rows = *reinterpret_cast<const FrameRows*>(memory);
  double* hessian = out.hessian + frame * 6 * d * d;
  double* jacobian = out.jacobian + frame * 3 * m * d;
  for_each(group, 6 * d * d, [&](int k) { hessian[k] = 0.0; });
  for_each(group, 3 * m * d, [&](int k) {
    const int q = k / (m * d), r = k / d % m;
    jacobian[k] = s.jacobians[(q * d + in.model.unactuated[r]) * d + k % d];
  });
  for (int k = 0; k < rows.count; ++k) add_set(group, rows.sets[k], d, hessian);
}

}  // namespace trajopt::inline TRAJOPT_ISA
