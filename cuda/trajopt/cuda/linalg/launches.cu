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

void launch_border_factor(const GroupPlan& plan, const PlanEntries& at, const GroupSystem& s,
                          const GroupBorder& b, const Stream& stream) {
  sequence_border_factor(StreamExecutor{stream}, plan, at, s, b);
}

void launch_border_solve(const GroupPlan& plan, const PlanEntries& at, const GroupSystem& s,
                         const GroupBorder& b, double* x, int m, const Stream& stream) {
  sequence_border_solve(StreamExecutor{stream}, plan, at, s, b, x, m);
}

void launch_border_refine(const GroupPlan& plan, const PlanEntries& at, const GroupSystem& s,
                          const GroupBorder& b, double* x, int m, int max_steps, double tolerance,
                          const BorderRefineArrays& a, const Stream& stream) {
  sequence_border_refine(StreamExecutor{stream}, plan, at, s, b, x, m, max_steps, tolerance, a);
}

void load_linalg_kernels() {
  load<group::BorderCopyWork>();
  load<group::BorderUpdateWork>();
  load<group::BorderEliminateWork>();
  load<group::BorderSolveWork>();
  load<group::BorderSpreadWork>();
  load<group::BorderResidualWork>();
  load<group::BorderDecideWork>();
  load<group::BorderCorrectWork>();
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

std::size_t border_shared_memory(int size, int border) {
  GroupSystem s;
  s.size = size;
  GroupBorder b;
  b.border = border;
  return std::max({group::BorderUpdateWork{s, b}.bytes(), group::BorderEliminateWork{s, b}.bytes(),
                   group::BorderSolveWork{s, b, {}}.bytes(),
                   group::BorderResidualWork{s, b, {}, nullptr, nullptr, nullptr}.bytes()});
}

std::size_t linalg_shared_memory_with_w(int size) {
  return std::max(linalg_shared_memory(size), group::VectorSpace::bytes(size, true));
}

}  // namespace trajopt::cuda
