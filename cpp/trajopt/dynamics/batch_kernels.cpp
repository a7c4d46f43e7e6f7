#include "trajopt/dynamics/batch_kernels.h"

#include "trajopt/base/lanes.h"
#include "trajopt/dynamics/residual.h"

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

std::size_t packs(const ModelView& m) {
  const std::size_t d = m.ndof;
  return 3 * d + d + 3 * d * d;
}

std::size_t scratch_bytes(const ModelView& m) {
  return packs(m) * sizeof(Lane) + DynamicsWorkspace<Lane>::bytes(m);
}

StencilPack<Lane> stencils(const Physics& physics, const DynamicsBatch& b, long begin, int count) {
  static_assert(sizeof(Stencil) == 15 * sizeof(double));
  constexpr int W = lanes<Lane>;
  Stencil rows[W];
  rows[0] = make_stencil(physics, b.dt[begin], b.dt_before[begin]);
  for (int w = 1; w < W; ++w) {
    const long i = begin + (w < count ? w : count - 1);
    const bool same =
        i == begin || (b.dt[i] == b.dt[i - 1] && b.dt_before[i] == b.dt_before[i - 1]);
    rows[w] = same ? rows[w - 1] : make_stencil(physics, b.dt[i], b.dt_before[i]);
  }
  Lane flat[15];
  load_lanes(rows[0].acceleration, 15, W, 15, flat);
  StencilPack<Lane> s;
  for (int q = 0; q < 3; ++q) {
    s.acceleration[q] = flat[q];
    s.contact[q] = flat[3 + q];
    for (int p = 0; p < 3; ++p) s.velocity[q][p] = flat[6 + 3 * q + p];
  }
  return s;
}

void run(const ModelView& m, const Physics& physics, const DynamicsBatch& b, long begin, int count,
         void* scratch) {
  const int d = m.ndof;
  Lane* x = static_cast<Lane*>(scratch);
  Lane* fd = x + 3 * d;
  Lane* jacobian = fd + d;
  DynamicsWorkspace<Lane> ws(m, jacobian + 3 * d * d);
  const double* from[3] = {b.x, b.x1, b.x2};
  for (int q = 0; q < 3; ++q) load_lanes(from[q] + begin * d, d, count, d, x + q * d);
  const Lane* nodes[3] = {x, x + d, x + 2 * d};
  Lane* js[3] = {jacobian, jacobian + d * d, jacobian + 2 * d * d};
  const StencilPack<Lane> stencil = stencils(physics, b, begin, count);
  if (b.jacobians[0] != nullptr) {
    dynamics_residual<Lane, Chart::vector, true>(m, physics, stencil, nodes, ws, fd, js);
    for (int q = 0; q < 3; ++q)
      store_lanes(js[q], d * d, b.jacobians[q] + begin * d * d, d * d, count);
  } else {
    dynamics_residual<Lane, Chart::vector, false>(m, physics, stencil, nodes, ws, fd, js);
  }
  store_lanes(fd, d, b.fd + begin * d, d, count);
}

}  // namespace

extern const BatchKernels kBatchKernels;
const BatchKernels kBatchKernels{lanes<Lane>, scratch_bytes, run};

}  // namespace TRAJOPT_ISA
}  // namespace trajopt
