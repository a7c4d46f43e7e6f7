#include "trajopt/cuda/base/launch.cuh"
#include "trajopt/cuda/linalg/launches.h"

namespace trajopt::cuda {

namespace {

using namespace linalg;

struct StreamExecutor {
  const Stream& stream;
  template <class Work>
  void operator()(const Work& work) const {
    launch(work, stream);
  }
};

}  // namespace

void launch_factor(const GroupPlan& plan, const PlanEntries& at, const GroupSystem& s,
                   const Stream& stream) {
  sequence_factor(StreamExecutor{stream}, plan, at, s);
}

void launch_solve(const GroupPlan& plan, const PlanEntries& at, const GroupSystem& s, double* x,
                  int m, const Stream& stream) {
  sequence_solve(StreamExecutor{stream}, plan, at, s, {x, m, nullptr});
}

void launch_refine_start(const GroupSystem& s, double* x, int m, int max_steps, double tolerance,
                         const RefineArrays& a, const Stream& stream) {
  sequence_refine_start(StreamExecutor{stream}, s, x, m, max_steps, tolerance, a);
}

void launch_refine_step(const GroupPlan& plan, const PlanEntries& at, const GroupSystem& s,
                        double* x, int m, int max_steps, double tolerance, const RefineArrays& a,
                        const Stream& stream) {
  sequence_refine_step(StreamExecutor{stream}, plan, at, s, x, m, max_steps, tolerance, a);
}

void load_linalg_kernels() {
  load<group::EliminateWork>();
  load<group::UpdateWork>();
  load<group::ForwardWork>();
  load<group::GatherWork>();
  load<group::BackwardWork>();
  load<group::ResidualWork>();
  load<group::DecideWork>();
  load<group::CorrectWork>();
}

std::size_t linalg_shared_memory(int size) {
  GroupSystem s;
  s.size = size;
  const GroupVectors v;
  return std::max({group::EliminateWork{s, nullptr, 0, 0}.bytes(),
                   group::UpdateWork{s, nullptr, 0, 0}.bytes(),
                   group::BackwardWork{s, v, nullptr, 0}.bytes(),
                   group::ResidualWork{s, v, nullptr, nullptr, nullptr}.bytes()});
}

std::size_t linalg_shared_memory_with_w(int size) {
  return std::max(linalg_shared_memory(size), group::VectorSpace::bytes(size, true));
}

}  // namespace trajopt::cuda
