// Packs against plain numbers: moves between packs and frames, products in register tiles, and the
// batch of every instruction set against one scalar frame after the other, bit for bit.
// Wide packs are split here, where no instruction set is asked for; nobody else calls these copies.
#pragma GCC diagnostic ignored "-Wpsabi"

#include <gtest/gtest.h>

#include <cmath>

#include "kernel_variants.h"
#include "problem/fixtures.h"
#include "trajopt/base/buffer.h"
#include "trajopt/base/lanes.h"
#include "trajopt/base/products.h"
#include "trajopt/dynamics/batch_kernels.h"
#include "trajopt/dynamics/residual.h"

namespace trajopt {

TRAJOPT_KERNEL_TABLE(BatchKernels, kBatchKernels, batch_tables)

namespace {

template <class S>
class Packs : public testing::Test {};
using Scalars = testing::Types<double, Pack<2>, Pack<4>, Pack<8>>;
TYPED_TEST_SUITE(Packs, Scalars);

TYPED_TEST(Packs, ElementsOfFramesThereAndBack) {
  constexpr int W = lanes<TypeParam>, stride = 41;
  std::vector<double> frames(W * stride + 8), back(frames.size());
  for (std::size_t i = 0; i < frames.size(); ++i) frames[i] = 1.0 + static_cast<double>(i);
  for (int n : {0, 1, 2, 3, 7, 8, 9, 17, 40}) {
    for (int count = 1; count <= W; ++count) {
      for (int skew = 0; skew < 8; ++skew) {
        std::vector<TypeParam> packs(n + 1);
        load_lanes(frames.data() + skew, stride, count, n, packs.data());
        for (int k = 0; k < n; ++k)
          for (int w = 0; w < W; ++w)
            ASSERT_EQ(lane(packs[k], w), frames[skew + std::min(w, count - 1) * stride + k]);
        std::fill(back.begin(), back.end(), -1.0);
        store_lanes(packs.data(), n, back.data() + skew, stride, count);
        for (std::size_t i = 0; i < back.size(); ++i) {
          const int at = static_cast<int>(i) - skew;
          const bool written = at >= 0 && at / stride < count && at % stride < n;
          ASSERT_EQ(back[i], written ? frames[i] : -1.0) << "n " << n << ", count " << count;
        }
      }
    }
  }
}

TYPED_TEST(Packs, NoNegativeZeroIsWritten) {
  const TypeParam zero(-0.0);
  double out[lanes<TypeParam>];
  store_lanes(&zero, 1, out, 1, lanes<TypeParam>);
  for (double x : out) EXPECT_FALSE(std::signbit(x));
}

TYPED_TEST(Packs, ComparisonsAreByLane) {
  constexpr int W = lanes<TypeParam>;
  for (int at = 0; at < W; ++at) {
    TypeParam x(1.0);
    set_lane(x, at, -2.0);
    EXPECT_TRUE(any(x < TypeParam(0.0)));
    EXPECT_FALSE(any(x < TypeParam(-3.0)));
    EXPECT_EQ(any(x > TypeParam(0.0)), W > 1);
    const TypeParam y = select(x < TypeParam(0.0), TypeParam(5.0), x);
    for (int w = 0; w < W; ++w) EXPECT_EQ(lane(y, w), w == at ? 5.0 : 1.0);
  }
  const TypeParam nan(std::nan(""));
  EXPECT_FALSE(any(nan < TypeParam(0.0)) || any(nan > TypeParam(0.0)));
}

// Every size that makes other tiles, two panels, and each way to begin and to leave out.
TYPED_TEST(Packs, ProductsInOrder) {
  constexpr int W = lanes<TypeParam>;
  test::Random random(3);
  for (int n = 1; n <= 14; ++n) {
    const int ld = n + 2, depths[2] = {3, 2};
    std::vector<int> index(n);
    for (int i = 0; i < n; ++i) index[i] = i < n / 2 ? i : i + 2;
    std::vector<TypeParam> values[4];
    for (int p = 0; p < 4; ++p) {
      values[p].resize(depths[p / 2] * n);
      for (TypeParam& v : values[p])
        for (int w = 0; w < W; ++w) set_lane(v, w, random());
    }
    const Panel<TypeParam> panels[2] = {{values[0].data(), values[1].data(), depths[0]},
                                        {values[2].data(), values[3].data(), depths[1]}};
    for (bool fresh : {false, true}) {
      for (bool lower : {false, true}) {
        std::vector<TypeParam> c(ld * ld, TypeParam(0.5));
        add_products(panels, 2, index.data(), n, fresh, lower, c.data(), ld);
        for (int w = 0; w < W; ++w) {
          for (int i = 0; i < n; ++i) {
            for (int j = 0; j < (lower ? i + 1 : n); ++j) {
              double sum = fresh ? 0.0 : 0.5;
              for (const Panel<TypeParam>& p : panels)
                for (int k = 0; k < p.depth; ++k)
                  sum = std::fma(lane(p.a[k * n + i], w), lane(p.b[k * n + j], w), sum);
              ASSERT_EQ(lane(c[index[i] * ld + index[j]], w), sum) << n << ": " << i << ", " << j;
            }
          }
        }
      }
    }
  }
}

// Rotation vectors small, zero and large in one pack, so that both branches of exp are taken.
TEST(Batch, BitsOfTheScalarResidual) {
  const Model model = test::make_character();
  const ModelView v = view(model);
  const int d = model.ndof, count = 21;
  test::Random random(5);
  for (Integrator integrator : {Integrator::implicit, Integrator::linear_acceleration}) {
    const Physics physics = test::make_physics(integrator);
    std::vector<double> x[3], dt(count), before(count);
    for (auto& node : x) node = random.vector(count * d, 0.4);
    for (int i = 0; i < count; i += 3)
      for (int k = 0; k < d; ++k)
        for (auto& node : x) node[i * d + k] = i == 0 ? 0.0 : 1e-4 * node[i * d + k];
    for (int i = 0; i < count; ++i) {
      dt[i] = i / 4 % 2 == 0 ? 0.2 : 0.15 + 0.1 * std::abs(random());
      before[i] = 0.2;
    }
    std::vector<double> fd(count * d), js(3 * count * d * d);
    const AlignedBuffer memory = aligned_buffer(DynamicsWorkspace<double>::bytes(v));
    for (int i = 0; i < count; ++i) {
      DynamicsWorkspace<double> ws(v, memory.get());
      const Stencil s = make_stencil(physics, dt[i], before[i]);
      StencilPack<double> stencil;
      for (int q = 0; q < 3; ++q) {
        stencil.acceleration[q] = s.acceleration[q];
        stencil.contact[q] = s.contact[q];
        for (int p = 0; p < 3; ++p) stencil.velocity[q][p] = s.velocity[q][p];
      }
      const double* nodes[3] = {x[0].data() + i * d, x[1].data() + i * d, x[2].data() + i * d};
      double* jacobians[3];
      for (int q = 0; q < 3; ++q) jacobians[q] = js.data() + (q * count + i) * d * d;
      dynamics_residual<double, Chart::vector, true>(v, physics, stencil, nodes, ws,
                                                     fd.data() + i * d, jacobians);
    }
    for (const auto& [name, kernels] : test::runnable(batch_tables())) {
      const AlignedBuffer scratch = aligned_buffer(kernels->scratch_bytes(v));
      for (bool derivatives : {false, true}) {
        std::vector<double> force(fd.size(), -1.0), jacobian(js.size(), -1.0);
        DynamicsBatch b{.count = count,
                        .x = x[0].data(),
                        .x1 = x[1].data(),
                        .x2 = x[2].data(),
                        .dt = dt.data(),
                        .dt_before = before.data(),
                        .fd = force.data()};
        for (int q = 0; derivatives && q < 3; ++q)
          b.jacobians[q] = jacobian.data() + q * count * d * d;
        for (long i = 0; i < count; i += kernels->lanes)
          kernels->run(v, physics, b, i,
                       static_cast<int>(std::min<long>(kernels->lanes, count - i)), scratch.get());
        EXPECT_EQ(force, fd) << name;
        if (derivatives) {
          EXPECT_EQ(jacobian, js) << name;
        }
      }
    }
  }
}

}  // namespace
}  // namespace trajopt
