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

template <class T>
void launch_factor(const GroupPlan& plan, const PlanEntries& at, const BasicGroupSystem<T>& s,
                   const Stream& stream) {
  sequence_factor(StreamExecutor{stream}, plan, at, s);
}

template <class T>
void launch_solve(const GroupPlan& plan, const PlanEntries& at, const BasicGroupSystem<T>& s,
                  double* x, int m, const GroupRounding& room, const Stream& stream) {
  sequence_solve(StreamExecutor{stream}, plan, at, s, {x, m, nullptr}, room);
}

void launch_refine_start(const GroupMatrix& s, double* x, int m, int max_steps, double tolerance,
                         const RefineArrays& a, const Stream& stream) {
  sequence_refine_start(StreamExecutor{stream}, s, x, m, max_steps, tolerance, a);
}

template <class T>
void launch_refine_step(const GroupPlan& plan, const PlanEntries& at, const BasicGroupSystem<T>& s,
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

template <class T>
void load_linalg_kernels() {
  load<group::EliminateWork<T>>();
  load<group::UpdateWork<T>>();
  load<group::ForwardWork<T>>();
  load<group::GatherWork<T>>();
  load<group::BackwardWork<T>>();
  load<group::ResidualWork>();
  load<group::DecideWork>();
  load<group::CorrectWork>();
  if constexpr (!std::is_same_v<T, double>) {
    load<group::PeakWork>();
    load<group::RoundWork>();
    load<group::RestoreWork>();
  }
}

void load_border_kernels() {
  load<group::BorderCopyWork>();
  load<group::BorderUpdateWork>();
  load<group::BorderEliminateWork>();
  load<group::BorderSolveWork>();
  load<group::BorderSpreadWork>();
  load<group::BorderResidualWork>();
  load<group::BorderDecideWork>();
  load<group::BorderCorrectWork>();
}

template <class T>
std::size_t linalg_shared_memory(int size) {
  BasicGroupSystem<T> s;
  s.size = size;
  const BasicGroupVectors<T> v;
  return std::max({group::EliminateWork<T>{s, nullptr, 0, 0}.bytes(),
                   group::UpdateWork<T>{s, nullptr, 0, 0}.bytes(),
                   group::BackwardWork<T>{s, v, nullptr, 0}.bytes(),
                   group::ResidualWork{s.matrix(), {}, nullptr, nullptr, nullptr}.bytes()});
}

template <class T>
std::size_t linalg_shared_memory_with_w(int size) {
  return std::max(linalg_shared_memory<T>(size), group::VectorSpace<T>::bytes(size, true));
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

#define TRAJOPT_INSTANTIATE(T)                                                                  \
  template void launch_factor(const GroupPlan&, const PlanEntries&, const BasicGroupSystem<T>&, \
                              const Stream&);                                                   \
  template void launch_solve(const GroupPlan&, const PlanEntries&, const BasicGroupSystem<T>&,  \
                             double*, int, const GroupRounding&, const Stream&);                \
  template void launch_refine_step(const GroupPlan&, const PlanEntries&,                        \
                                   const BasicGroupSystem<T>&, double*, int, int, double,       \
                                   const RefineArrays&, const Stream&);                         \
  template void load_linalg_kernels<T>();                                                       \
  template std::size_t linalg_shared_memory<T>(int);                                            \
  template std::size_t linalg_shared_memory_with_w<T>(int);

TRAJOPT_INSTANTIATE(double)
TRAJOPT_INSTANTIATE(float)

}  // namespace trajopt::cuda
