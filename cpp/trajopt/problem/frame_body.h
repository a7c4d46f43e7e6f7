// What is computed for a pack of frames: dynamics, objective rows, and their Gauss-Newton Hessian.
// One body for every executor: the CPU runs it with packs, a GPU thread with plain doubles.
#pragma once

#include "trajopt/problem/contact_rows.h"
#include "trajopt/problem/dense_rows.h"
#include "trajopt/problem/frame_kernels.h"
#include "trajopt/problem/gram.h"

namespace trajopt::inline TRAJOPT_ISA {

TRAJOPT_HD inline int row_count(const FrameInput& in) {
  int rows = 0;
  for (int k = 0; k < in.nterm; ++k) rows += rows_of(in.terms[k].kind, in.model);
  return rows + (in.augmentation > 0 ? in.model.nunactuated : 0);
}

// Buffers of one worker, in packs.
template <class S>
struct FrameScratch {
  S *nodes, *fd, *jacobians, *residual, *rows, *hessian;
  void* dynamics;

  TRAJOPT_HD static std::size_t packs(const FrameInput& in) {
    const std::size_t d = in.model.ndof, r = row_count(in);
    return 3 * in.model.nq + d + 3 * d * d + r + r * 3 * d + 6 * d * d;
  }
  TRAJOPT_HD FrameScratch(const FrameInput& in, void* memory) {
    const int d = in.model.ndof, r = row_count(in);
    nodes = static_cast<S*>(memory);
    fd = nodes + 3 * in.model.nq;
    jacobians = fd + d;
    residual = jacobians + 3 * d * d;
    rows = residual + r;
    hessian = rows + r * 3 * d;
    dynamics = hessian + 6 * d * d;
  }
};

template <class S>
TRAJOPT_HD inline std::size_t frame_scratch_bytes(const FrameInput& in) {
  return FrameScratch<S>::packs(in) * sizeof(S) + DynamicsWorkspace<S>::bytes(in.model) + 64;
}

// Frames [begin, begin + count), count <= lanes<S>; the outputs of other frames are left alone.
template <class S, bool Derivatives>
TRAJOPT_HD inline void run_frames(const FrameInput& in, long begin, int count, void* memory,
                                  const FrameOutput& out) {
  const ModelView& model = in.model;
  const int d = model.ndof, m = model.nunactuated, nu = model.nactuated;
  FrameScratch<S> s(in, memory);
  DynamicsWorkspace<S> ws(model, s.dynamics);

  // Lanes beyond count repeat the last frame; their results are dropped.
  const auto frame_of = [&](int w) { return begin + (w < count ? w : count - 1); };
  StencilPack<S> stencil;
  S inverse_dt, inverse_dt_before;
  for (int w = 0; w < lanes<S>; ++w) {
    const long f = frame_of(w);
    const Stencil& st = in.stencils[f];
    for (int q = 0; q < 3; ++q) {
      set_lane(stencil.acceleration[q], w, st.acceleration[q]);
      set_lane(stencil.contact[q], w, st.contact[q]);
      for (int p = 0; p < 3; ++p) set_lane(stencil.velocity[q][p], w, st.velocity[q][p]);
      const double* x = in.frames + (f + 2 - q) * model.nq;
      for (int k = 0; k < model.nq; ++k) set_lane(s.nodes[q * model.nq + k], w, x[k]);
    }
    set_lane(inverse_dt, w, 1.0 / in.dt[f + 1]);
    set_lane(inverse_dt_before, w, 1.0 / in.dt[f]);
  }
  const S* nodes[3] = {s.nodes, s.nodes + model.nq, s.nodes + 2 * model.nq};
  S* jacobians[3] = {s.jacobians, s.jacobians + d * d, s.jacobians + 2 * d * d};
  dynamics_residual<S, Chart::tangent, Derivatives>(model, *in.physics, stencil, nodes, ws, s.fd,
                                                    jacobians);

  for (int w = 0; w < count; ++w) {
    for (int r = 0; r < m; ++r)
      out.constraint[(begin + w) * m + r] = lane(s.fd[model.unactuated[r]], w);
    for (int r = 0; r < nu; ++r)
      out.torque[(begin + w) * nu + r] = lane(s.fd[model.actuated[r]], w);
  }

  int rows = 0;
  for (int k = 0; k < in.nterm; ++k) {
    const DenseTerm& term = in.terms[k];
    S scale;
    Vec3<S> target{S(0.0), S(0.0), S(0.0)};
    for (int w = 0; w < lanes<S>; ++w) {
      const long f = frame_of(w);
      set_lane(scale, w, term.scale[f]);
      if (term.target != nullptr)
        for (int c = 0; c < 3; ++c) set_lane(target[c], w, term.target[3 * f + c]);
    }
    const S* const js[3] = {jacobians[0], jacobians[1], jacobians[2]};
    const int first = rows;
    const RowBlock<S> block{s.residual + first, s.rows + first * 3 * d};
    if (term.kind == DenseKind::contact_rate) {
      rows += contact_rate_rows<S, Derivatives>(model, *in.physics, ws, scale, inverse_dt,
                                                inverse_dt_before, block);
    } else if (term.kind == DenseKind::contact_slip) {
      rows += contact_slip_rows<S, Derivatives>(model, *in.physics, ws, scale, inverse_dt, block);
    } else {
      rows += rows_of(term.kind, model);
      dense_rows<S, Derivatives>(model, term, ws, s.fd, js, scale, target, inverse_dt, block);
    }
    S cost(0.0);
    for (int r = first; r < rows; ++r) cost = fma(s.residual[r], s.residual[r], cost);
    for (int w = 0; w < count; ++w) out.cost[(begin + w) * in.nterm + k] = 0.5 * lane(cost, w);
  }
  if constexpr (!Derivatives) return;

  for (int w = 0; w < count; ++w) {
    double* a = out.jacobian + (begin + w) * 3 * m * d;
    for (int q = 0; q < 3; ++q)
      for (int r = 0; r < m; ++r)
        for (int j = 0; j < d; ++j)
          a[(q * m + r) * d + j] = lane(jacobians[q][model.unactuated[r] * d + j], w);
  }
  for (int i = 0; i < 3 * d; ++i) {
    S g(0.0);
    for (int r = 0; r < rows; ++r) g = fma(s.rows[r * 3 * d + i], s.residual[r], g);
    for (int w = 0; w < count; ++w) out.gradient[(begin + w) * 3 * d + i] = lane(g, w);
  }
  if (in.augmentation > 0) {
    const S scale(__builtin_sqrt(in.augmentation));
    for (int r = 0; r < m; ++r, ++rows)
      for (int q = 0; q < 3; ++q)
        for (int j = 0; j < d; ++j)
          s.rows[rows * 3 * d + q * d + j] = scale * jacobians[q][model.unactuated[r] * d + j];
  }
  window_gram(s.rows, rows, d, s.hessian);
  for (int w = 0; w < count; ++w) {
    double* h = out.hessian + (begin + w) * 6 * d * d;
    for (int i = 0; i < 6 * d * d; ++i) h[i] = lane(s.hessian[i], w);
  }
}

}  // namespace trajopt::inline TRAJOPT_ISA
