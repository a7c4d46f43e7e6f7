#include "trajopt/problem/contact_rows.h"
#include "trajopt/problem/dense_rows.h"
#include "trajopt/problem/frame_kernels.h"
#include "trajopt/problem/gram.h"

namespace trajopt {
inline namespace TRAJOPT_ISA {
namespace {

#if defined(__AVX512F__)
using Lane = Pack<8>;
#elif defined(__AVX2__)
using Lane = Pack<4>;
#else
using Lane = Pack<2>;
#endif

int row_count(const FrameInput& in) {
  int rows = 0;
  for (int k = 0; k < in.nterm; ++k) rows += rows_of(in.terms[k].kind, in.model);
  return rows + (in.augmentation > 0 ? in.model.nunactuated : 0);
}

// Buffers of one worker, in packs.
struct Scratch {
  Lane *nodes, *fd, *jacobians, *residual, *rows, *hessian;
  void* dynamics;

  static std::size_t packs(const FrameInput& in) {
    const std::size_t d = in.model.ndof, r = row_count(in);
    return 3 * in.model.nq + d + 3 * d * d + r + r * 3 * d + 6 * d * d;
  }
  Scratch(const FrameInput& in, void* memory) {
    const int d = in.model.ndof, r = row_count(in);
    nodes = static_cast<Lane*>(memory);
    fd = nodes + 3 * in.model.nq;
    jacobians = fd + d;
    residual = jacobians + 3 * d * d;
    rows = residual + r;
    hessian = rows + r * 3 * d;
    dynamics = hessian + 6 * d * d;
  }
};

std::size_t scratch_bytes(const FrameInput& in) {
  return Scratch::packs(in) * sizeof(Lane) + DynamicsWorkspace<Lane>::bytes(in.model) + 64;
}

template <bool Derivatives>
void run(const FrameInput& in, long begin, int count, void* memory, const FrameOutput& out) {
  const ModelView& model = in.model;
  const int d = model.ndof, m = model.nunactuated, nu = model.nactuated;
  Scratch s(in, memory);
  DynamicsWorkspace<Lane> ws(model, s.dynamics);

  // Lanes beyond count repeat the last frame; their results are dropped.
  const auto frame_of = [&](int lane) { return begin + (lane < count ? lane : count - 1); };
  StencilPack<Lane> stencil;
  Lane inverse_dt, inverse_dt_before;
  for (int w = 0; w < lanes<Lane>; ++w) {
    const long f = frame_of(w);
    const Stencil& st = in.stencils[f];
    for (int q = 0; q < 3; ++q) {
      stencil.acceleration[q].set(w, st.acceleration[q]);
      stencil.contact[q].set(w, st.contact[q]);
      for (int p = 0; p < 3; ++p) stencil.velocity[q][p].set(w, st.velocity[q][p]);
      const double* x = in.frames + (f + 2 - q) * model.nq;
      for (int k = 0; k < model.nq; ++k) s.nodes[q * model.nq + k].set(w, x[k]);
    }
    inverse_dt.set(w, 1.0 / in.dt[f + 1]);
    inverse_dt_before.set(w, 1.0 / in.dt[f]);
  }
  const Lane* nodes[3] = {s.nodes, s.nodes + model.nq, s.nodes + 2 * model.nq};
  Lane* jacobians[3] = {s.jacobians, s.jacobians + d * d, s.jacobians + 2 * d * d};
  dynamics_residual<Lane, Chart::tangent, Derivatives>(model, *in.physics, stencil, nodes, ws, s.fd,
                                                       jacobians);

  for (int w = 0; w < count; ++w) {
    for (int r = 0; r < m; ++r) out.constraint[(begin + w) * m + r] = s.fd[model.unactuated[r]][w];
    for (int r = 0; r < nu; ++r) out.torque[(begin + w) * nu + r] = s.fd[model.actuated[r]][w];
  }

  int rows = 0;
  for (int k = 0; k < in.nterm; ++k) {
    const DenseTerm& term = in.terms[k];
    Lane scale;
    Vec3<Lane> target{Lane(0.0), Lane(0.0), Lane(0.0)};
    for (int w = 0; w < lanes<Lane>; ++w) {
      const long f = frame_of(w);
      scale.set(w, term.scale[f]);
      if (term.target != nullptr)
        for (int c = 0; c < 3; ++c) target[c].set(w, term.target[3 * f + c]);
    }
    const Lane* const js[3] = {jacobians[0], jacobians[1], jacobians[2]};
    const int first = rows;
    const RowBlock<Lane> block{s.residual + first, s.rows + first * 3 * d};
    if (term.kind == DenseKind::contact_rate) {
      rows += contact_rate_rows<Lane, Derivatives>(model, *in.physics, ws, scale, inverse_dt,
                                                   inverse_dt_before, block);
    } else if (term.kind == DenseKind::contact_slip) {
      rows +=
          contact_slip_rows<Lane, Derivatives>(model, *in.physics, ws, scale, inverse_dt, block);
    } else {
      rows += rows_of(term.kind, model);
      dense_rows<Lane, Derivatives>(model, term, ws, s.fd, js, scale, target, inverse_dt, block);
    }
    Lane cost(0.0);
    for (int r = first; r < rows; ++r) cost = fma(s.residual[r], s.residual[r], cost);
    for (int w = 0; w < count; ++w) out.cost[(begin + w) * in.nterm + k] = 0.5 * cost[w];
  }
  if constexpr (!Derivatives) return;

  for (int w = 0; w < count; ++w) {
    double* a = out.jacobian + (begin + w) * 3 * m * d;
    for (int q = 0; q < 3; ++q)
      for (int r = 0; r < m; ++r)
        for (int j = 0; j < d; ++j)
          a[(q * m + r) * d + j] = jacobians[q][model.unactuated[r] * d + j][w];
  }
  for (int i = 0; i < 3 * d; ++i) {
    Lane g(0.0);
    for (int r = 0; r < rows; ++r) g = fma(s.rows[r * 3 * d + i], s.residual[r], g);
    for (int w = 0; w < count; ++w) out.gradient[(begin + w) * 3 * d + i] = g[w];
  }
  if (in.augmentation > 0) {
    const Lane scale(__builtin_sqrt(in.augmentation));
    for (int r = 0; r < m; ++r, ++rows)
      for (int q = 0; q < 3; ++q)
        for (int j = 0; j < d; ++j)
          s.rows[rows * 3 * d + q * d + j] = scale * jacobians[q][model.unactuated[r] * d + j];
  }
  window_gram(s.rows, rows, d, s.hessian);
  for (int w = 0; w < count; ++w) {
    double* h = out.hessian + (begin + w) * 6 * d * d;
    for (int i = 0; i < 6 * d * d; ++i) h[i] = s.hessian[i][w];
  }
}

void evaluate(const FrameInput& in, long begin, int count, void* scratch, const FrameOutput& out) {
  run<false>(in, begin, count, scratch, out);
}
void linearize(const FrameInput& in, long begin, int count, void* scratch, const FrameOutput& out) {
  run<true>(in, begin, count, scratch, out);
}

}  // namespace

extern const FrameKernels kFrameKernels;
const FrameKernels kFrameKernels{lanes<Lane>, scratch_bytes, evaluate, linearize};

}  // namespace TRAJOPT_ISA
}  // namespace trajopt
