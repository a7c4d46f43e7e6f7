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

// Buffers of one worker.
template <class S>
struct FrameScratch {
  S *nodes, *fd, *picked, *cost, *jacobians, *gradient, *block;
  void *dynamics, *rows;
  Panel<S>* panels;

  TRAJOPT_HD static std::size_t packs(const FrameInput& in) {
    const std::size_t d = in.model.ndof;
    return 3 * in.model.nq + 2 * d + in.nterm + 3 * d * d + 3 * d + d * d;
  }
  TRAJOPT_HD FrameScratch(const FrameInput& in, void* memory) {
    const int d = in.model.ndof;
    nodes = static_cast<S*>(memory);
    fd = nodes + 3 * in.model.nq;
    picked = fd + d;
    cost = picked + d;
    jacobians = cost + in.nterm;
    gradient = jacobians + 3 * d * d;
    block = gradient + 3 * d;
    dynamics = block + d * d;
    rows = static_cast<char*>(dynamics) + DynamicsWorkspace<S>::bytes(in.model);
    panels =
        reinterpret_cast<Panel<S>*>(static_cast<char*>(rows) + RowList<S>::bytes(row_count(in), d));
  }
};

template <class S>
TRAJOPT_HD inline std::size_t frame_scratch_bytes(const FrameInput& in) {
  return FrameScratch<S>::packs(in) * sizeof(S) + DynamicsWorkspace<S>::bytes(in.model) +
         RowList<S>::bytes(row_count(in), in.model.ndof) + row_count(in) * sizeof(Panel<S>) + 64;
}

// The time step's numbers and the configurations of a pack's frames.
template <class S>
struct FramePack {
  StencilPack<S> stencil;
  S inverse_dt, inverse_dt_before;
  const S* nodes[3];

  TRAJOPT_HD FramePack(const FrameInput& in, long begin, int count, S* memory) {
    static_assert(sizeof(Stencil) == 15 * sizeof(double));
    const int nq = in.model.nq;
    S flat[15];
    load_lanes(in.stencils[begin].acceleration, 15, count, 15, flat);
    for (int q = 0; q < 3; ++q) {
      stencil.acceleration[q] = flat[q];
      stencil.contact[q] = flat[3 + q];
      for (int p = 0; p < 3; ++p) stencil.velocity[q][p] = flat[6 + 3 * q + p];
      nodes[q] = memory + q * nq;
      load_lanes(in.frames + (begin + 2 - q) * nq, nq, count, nq, memory + q * nq);
    }
    S dt[2];
    load_lanes(in.dt + begin, 1, count, 1, dt);
    load_lanes(in.dt + begin + 1, 1, count, 1, dt + 1);
    inverse_dt_before = S(1.0) / dt[0];
    inverse_dt = S(1.0) / dt[1];
  }
};

// Some elements of `in`, one behind the other, to each frame's own array of n.
template <class S>
TRAJOPT_HD inline void store_picked(const S* in, const int* index, int n, S* picked, double* out,
                                    int count) {
  for (int r = 0; r < n; ++r) picked[r] = in[index[r]];
  store_lanes(picked, n, out, n, count);
}

// The rows of all terms, and the cost of each.
template <class S, bool Derivatives>
TRAJOPT_HD inline void objective_rows(const FrameInput& in, long begin, int count,
                                      const FramePack<S>& frame, DynamicsWorkspace<S>& ws,
                                      const S* fd, const S* const jacobians[3], RowList<S>& rows,
                                      S* costs) {
  const ModelView& model = in.model;
  for (int k = 0; k < in.nterm; ++k) {
    const DenseTerm& term = in.terms[k];
    S scale;
    Vec3<S> target{S(0.0), S(0.0), S(0.0)};
    load_lanes(term.scale + begin, 1, count, 1, &scale);
    S cost(0.0);
    if (any(scale > S(0.0)) || any(S(0.0) > scale)) {  // else: switched off in every lane
      if (term.target != nullptr) load_lanes(term.target + 3 * begin, 3, count, 3, &target.x);
      const S* first = rows.residual();
      switch (term.kind) {
        case DenseKind::contact_rate:
          contact_rate_rows<S, Derivatives>(model, *in.physics, ws, scale, frame.inverse_dt,
                                            frame.inverse_dt_before, rows);
          break;
        case DenseKind::contact_slip:
          contact_slip_rows<S, Derivatives>(model, *in.physics, ws, scale, frame.inverse_dt, rows);
          break;
        case DenseKind::contact_impact:
          contact_impact_rows<S, Derivatives>(model, *in.physics, ws, scale, frame.inverse_dt,
                                              rows);
          break;
        case DenseKind::effort:
        case DenseKind::physics: {
          const bool effort = term.kind == DenseKind::effort;
          const int* dofs = effort ? model.actuated : model.unactuated;
          const int n = effort ? model.nactuated : model.nunactuated;
          if constexpr (Derivatives) {
            force_rows(model, dofs, n, ws, fd, jacobians, scale, rows);
          } else {
            force_residuals(dofs, n, fd, scale, rows.residual());
            rows.add_residuals(n);
          }
          break;
        }
        default:
          point_rows<S, Derivatives>(model, term, ws, scale, target, frame.inverse_dt, rows);
      }
      for (const S* r = first; r != rows.residual(); ++r) cost = fma(*r, *r, cost);
    }
    costs[k] = S(0.5) * cost;
  }
}

// All of the frames' outputs but the Hessian and the Jacobians, whose sources stay in `s`: the rows
// returned, and s.jacobians.
template <class S, bool Derivatives>
TRAJOPT_HD inline RowList<S> frame_rows(const FrameInput& in, long begin, int count,
                                        const FrameScratch<S>& s, const FrameOutput& out) {
  const ModelView& model = in.model;
  const int d = model.ndof, m = model.nunactuated, nu = model.nactuated;
  DynamicsWorkspace<S> ws(model, s.dynamics);
  const FramePack<S> frame(in, begin, count, s.nodes);
  S* jacobians[3] = {s.jacobians, s.jacobians + d * d, s.jacobians + 2 * d * d};
  dynamics_residual<S, Chart::tangent, Derivatives>(model, *in.physics, frame.stencil, frame.nodes,
                                                    ws, s.fd, jacobians);
  store_picked(s.fd, model.unactuated, m, s.picked, out.constraint + begin * m, count);
  store_picked(s.fd, model.actuated, nu, s.picked, out.torque + begin * nu, count);

  RowList<S> rows(row_count(in), d, s.rows);
  const S* const js[3] = {jacobians[0], jacobians[1], jacobians[2]};
  if constexpr (Derivatives) {
    if (in.augmentation > 0) {
      const S* none = nullptr;
      force_rows(model, model.unactuated, m, ws, none, js, S(__builtin_sqrt(in.augmentation)),
                 rows);
    }
  }
  objective_rows<S, Derivatives>(in, begin, count, frame, ws, s.fd, js, rows, s.cost);
  store_lanes(s.cost, in.nterm, out.cost + begin * in.nterm, in.nterm, count);
  if constexpr (Derivatives) {
    window_gradient(rows, d, s.gradient);
    store_lanes(s.gradient, 3 * d, out.gradient + begin * 3 * d, 3 * d, count);
  }
  return rows;
}

// Frames [begin, begin + count), count <= lanes<S>; the outputs of other frames are left alone.
template <class S, bool Derivatives>
TRAJOPT_HD inline void run_frames(const FrameInput& in, long begin, int count, void* memory,
                                  const FrameOutput& out) {
  const FrameScratch<S> s(in, memory);
  const RowList<S> rows = frame_rows<S, Derivatives>(in, begin, count, s, out);
  if constexpr (Derivatives) {
    const int d = in.model.ndof, m = in.model.nunactuated;
    for (int q = 0; q < 3; ++q)
      for (int r = 0; r < m; ++r)
        store_lanes(s.jacobians + (q * d + in.model.unactuated[r]) * d, d,
                    out.jacobian + ((begin * 3 + q) * m + r) * d, 3 * m * d, count);
    for (int b = 0; b < 6; ++b) {
      window_block(rows, kWindowBlocks[b][0], kWindowBlocks[b][1], d, s.panels, s.block);
      store_lanes(s.block, d * d, out.hessian + (begin * 6 + b) * d * d, 6 * d * d, count);
    }
  }
}

}  // namespace trajopt::inline TRAJOPT_ISA
