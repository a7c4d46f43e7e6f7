// The launches of group_sequence.h in a CUDA stream. The header needs no nvcc.
#pragma once

#include "trajopt/cuda/base/stream.h"
#include "trajopt/linalg/group_border_sequence.h"

namespace trajopt::cuda {

// T, the scalar type of the factors: double or float.
template <class T>
void launch_factor(const linalg::GroupPlan& plan, const linalg::PlanEntries& at,
                   const linalg::BasicGroupSystem<T>& s, const Stream& stream);
template <class T>
void launch_solve(const linalg::GroupPlan& plan, const linalg::PlanEntries& at,
                  const linalg::BasicGroupSystem<T>& s, double* x, int m,
                  const linalg::GroupRounding& room, const Stream& stream);
void launch_refine_start(const linalg::GroupMatrix& s, double* x, int m, int max_steps,
                         double tolerance, const linalg::RefineArrays& a, const Stream& stream);
template <class T>
void launch_refine_step(const linalg::GroupPlan& plan, const linalg::PlanEntries& at,
                        const linalg::BasicGroupSystem<T>& s, double* x, int m, int max_steps,
                        double tolerance, const linalg::RefineArrays& a, const Stream& stream);

// The same for a border, whose factorization follows that of the chain.
void launch_border_factor(const linalg::GroupPlan& plan, const linalg::PlanEntries& at,
                          const linalg::GroupSystem& s, const linalg::GroupBorder& b,
                          const Stream& stream);
void launch_border_solve(const linalg::GroupPlan& plan, const linalg::PlanEntries& at,
                         const linalg::GroupSystem& s, const linalg::GroupBorder& b, double* x,
                         int m, const Stream& stream);
void launch_border_refine(const linalg::GroupPlan& plan, const linalg::PlanEntries& at,
                          const linalg::GroupSystem& s, const linalg::GroupBorder& b, double* x,
                          int m, int max_steps, double tolerance,
                          const linalg::BorderRefineArrays& a, const Stream& stream);

// Loads all kernels of the above: with factors in T, and those of a border.
template <class T>
void load_linalg_kernels();
void load_border_kernels();

// Most shared memory that one of them needs for blocks of this size.
template <class T>
std::size_t linalg_shared_memory(int size);
// The same with W in shared memory while solving.
template <class T>
std::size_t linalg_shared_memory_with_w(int size);
// Most that the launches of a border of blocks of this size need.
std::size_t border_shared_memory(int size, int border);

}  // namespace trajopt::cuda
