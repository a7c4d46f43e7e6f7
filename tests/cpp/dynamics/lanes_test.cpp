// The SIMD kernels against the scalar instantiation of the same formulas, bit for bit, for every
// instruction set this machine has; and no heap allocation in them.
#include <gtest/gtest.h>

#include <cstring>

#include "counting_allocator.h"
#include "kernel_variants.h"
#include "problem/fixtures.h"
#include "trajopt/base/buffer.h"
#include "trajopt/dynamics/residual.h"

namespace trajopt {

TRAJOPT_KERNEL_TABLE(FrameKernels, kFrameKernels, frame_tables)

namespace {

// Everything a kernel reads and writes, for one problem.
struct Frames {
  explicit Frames(Integrator integrator)
      : model(test::make_character()),
        physics(test::make_physics(integrator)),
        random(7),
        objective(test::every_term(model, count, random)) {
    for (double& h : dt) h = 0.15 + 0.1 * std::abs(random());
    frames.resize((count + 2) * model.nq);
    configuration_from_vector(model, random.vector(model.ndof, 0.3).data(), frames.data());
    for (int i = 1; i < count + 2; ++i)
      integrate(model, frames.data() + (i - 1) * model.nq, random.vector(model.ndof, 0.3).data(),
                frames.data() + i * model.nq);
    for (int i = 1; i <= count; ++i) stencils.push_back(make_stencil(physics, dt[i], dt[i - 1]));
    for (DenseObjective& term : objective.dense) {
      term.term.scale = term.weight.data();
      term.term.target = term.target.empty() ? nullptr : term.target.data();
      terms.push_back(term.term);
    }
  }

  FrameInput input() {
    return {view(model),
            &physics,
            stencils.data(),
            dt,
            frames.data(),
            terms.data(),
            static_cast<int>(terms.size()),
            1e-3};
  }

  static constexpr int count = 13;  // not a multiple of any number of lanes
  Model model;
  Physics physics;
  test::Random random;
  Objective objective;
  double dt[count + 1];
  std::vector<double> frames;
  std::vector<Stencil> stencils;
  std::vector<DenseTerm> terms;
};

struct Outputs {
  explicit Outputs(const Frames& f) {
    const std::size_t n = Frames::count, d = f.model.ndof, m = f.model.unactuated.size();
    constraint.resize(n * m);
    torque.resize(n * f.model.actuated.size());
    cost.resize(n * f.terms.size());
    hessian.resize(n * 6 * d * d);
    gradient.resize(n * 3 * d);
    jacobian.resize(n * 3 * m * d);
  }
  FrameOutput pointers() {
    return {constraint.data(), torque.data(),   cost.data(),
            hessian.data(),    gradient.data(), jacobian.data()};
  }
  std::vector<double> constraint, torque, cost, hessian, gradient, jacobian;
};

void linearize(const FrameKernels& kernels, const FrameInput& in, void* scratch,
               const FrameOutput& out) {
  for (long begin = 0; begin < Frames::count; begin += kernels.lanes)
    kernels.linearize(in, begin,
                      static_cast<int>(std::min<long>(kernels.lanes, Frames::count - begin)),
                      scratch, out);
}

class Lanes : public testing::TestWithParam<Integrator> {};

TEST_P(Lanes, BitsOfTheScalarResidual) {
  Frames f(GetParam());
  const FrameInput in = f.input();
  const int d = f.model.ndof, nq = f.model.nq;
  const AlignedBuffer memory = aligned_buffer(DynamicsWorkspace<double>::bytes(in.model));
  std::vector<double> fd(d), js(3 * d * d), constraint, torque, jacobian;
  for (int i = 0; i < Frames::count; ++i) {
    DynamicsWorkspace<double> ws(in.model, memory.get());
    StencilPack<double> stencil;
    for (int q = 0; q < 3; ++q) {
      stencil.acceleration[q] = f.stencils[i].acceleration[q];
      stencil.contact[q] = f.stencils[i].contact[q];
      for (int p = 0; p < 3; ++p) stencil.velocity[q][p] = f.stencils[i].velocity[q][p];
    }
    const double* newest = f.frames.data() + (i + 2) * nq;
    const double* nodes[3] = {newest, newest - nq, newest - 2 * nq};
    double* jacobians[3] = {js.data(), js.data() + d * d, js.data() + 2 * d * d};
    dynamics_residual<double, Chart::tangent, true>(in.model, f.physics, stencil, nodes, ws,
                                                    fd.data(), jacobians);
    for (int r : f.model.unactuated) constraint.push_back(fd[r]);
    for (int r : f.model.actuated) torque.push_back(fd[r]);
    for (const double* j : jacobians)
      for (int r : f.model.unactuated) jacobian.insert(jacobian.end(), j + r * d, j + (r + 1) * d);
  }
  for (const auto& [name, kernels] : test::runnable(frame_tables())) {
    const AlignedBuffer scratch = aligned_buffer(kernels->scratch_bytes(in));
    Outputs out(f);
    linearize(*kernels, in, scratch.get(), out.pointers());
    EXPECT_EQ(out.constraint, constraint) << name;
    EXPECT_EQ(out.torque, torque) << name;
    EXPECT_EQ(out.jacobian, jacobian) << name;
  }
}

TEST_P(Lanes, SameBitsForEveryInstructionSet) {
  Frames f(GetParam());
  const FrameInput in = f.input();
  Outputs reference(f);
  for (const auto& [name, kernels] : test::runnable(frame_tables())) {
    const AlignedBuffer scratch = aligned_buffer(kernels->scratch_bytes(in));
    Outputs out(f);
    linearize(*kernels, in, scratch.get(), out.pointers());
    if (kernels == &portable::kFrameKernels) reference = out;
    EXPECT_EQ(out.cost, reference.cost) << name;
    EXPECT_EQ(out.gradient, reference.gradient) << name;
    EXPECT_EQ(out.hessian, reference.hessian) << name;
  }
}

TEST_P(Lanes, NoAllocation) {
  Frames f(GetParam());
  const FrameInput in = f.input();
  Outputs out(f);
  for (const auto& [name, kernels] : test::runnable(frame_tables())) {
    const AlignedBuffer scratch = aligned_buffer(kernels->scratch_bytes(in));
    linearize(*kernels, in, scratch.get(), out.pointers());
    const long before = test::allocations;
    linearize(*kernels, in, scratch.get(), out.pointers());
    for (long i = 0; i < Frames::count; ++i)
      kernels->evaluate(in, i, 1, scratch.get(), out.pointers());
    EXPECT_EQ(test::allocations - before, 0) << name;
  }
}

INSTANTIATE_TEST_SUITE_P(Integrators, Lanes,
                         testing::Values(Integrator::implicit, Integrator::verlet,
                                         Integrator::fox_goodwin, Integrator::linear_acceleration,
                                         Integrator::trapezoidal));

}  // namespace
}  // namespace trajopt
