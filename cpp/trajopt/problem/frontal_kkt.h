// Frame by frame elimination of the KKT system of the frames formulation: a frontal method (Irons
// 1970) on a chain. A front holds one node, whose rows are the pivots, and the nodes that its
// elimination couples, which stay. It is written from the matrix by nodes (node_rows.h), receives
// the Schur complement of the front before, is eliminated, and leaves its own.
//
// Two sweeps meet in the middle:
//
//   down   from the last node: {y_i, x_i} leaves x_{i-1} and x_{i-2} coupled. Whatever else its
//          constraint touches comes before it, so no multiplier stays: 2 D columns
//   up     from the first node: {y_i, x_i} leaves nodes i+1 and i+2, multipliers and all
//   root   the two nodes between them
//
// For D = 18 unknowns and m = 6 constraints a node costs 28 k (down) and 44 k (up) multiply-adds;
// in blocks of two nodes whose zeros are not known it costs 64 k. The share of the nodes that goes
// up, 3/7, gives two threads the same to do. The bits do not depend on threads.
#pragma once

#include <vector>

#include "trajopt/linalg/refinement.h"
#include "trajopt/problem/front_sweep.h"

namespace trajopt {

class FrontalKkt {
 public:
  FrontalKkt(int nodes, int primal, int dual, Isa isa = Isa::avx512,
             linalg::Storage storage = linalg::Storage::automatic);

  // Factors the KKT matrix of `rows` with -epsilon on the multipliers' diagonal. Throws
  // FactorizationError, naming node and row, when a pivot is not finite, is zero to working
  // accuracy or has the wrong sign. The arrays of `rows` are read again by refine() and residual().
  void factor(const NodeRows& rows, double epsilon, int threads);

  // The same with the first half of solve(x, m), which then reads the factors while they are in
  // cache, and the second half. A factorization that fails leaves x undefined. finish() throws
  // ArgumentError unless the last call but residual() was factor_and_begin(), for as many columns.
  void factor_and_begin(const NodeRows& rows, double epsilon, double* x, int m, int threads);
  void finish(double* x, int m, int threads);

  // Solves in place; x is (nodes * (dual + primal), m), row-major. Throws ArgumentError unless
  // factor() has succeeded.
  void solve(double* x, int m, int threads);

  // Improves x towards K x = rhs, K without epsilon, as linalg::Factorization::refine does.
  linalg::Refinement refine(const NodeRows& rows, const double* rhs, double* x, int m,
                            int max_steps, double tolerance, int threads);

  // r = rhs - K x; rhs == nullptr is zero. Returns the largest magnitude of r.
  double residual(const NodeRows& rows, const double* rhs, const double* x, double* r, int m,
                  int threads);

 private:
  static constexpr int kChunk = 64;  // nodes of a residual that one worker does at a time

  // Of a node's rows' columns: whole cache lines.
  long product_ld() const { return linalg::padded(2 * primal_ + width_ + 8); }
  long row_count() const { return static_cast<long>(nodes_) * width_; }
  void grow_kept(int m);
  void second_half(double* x, int m, int threads);
  void factor_root(const NodeRows& rows, double epsilon);
  void add_schur_to_root();
  void solve_root(double* x, int m);
  void residual_of_chunk(const NodeRows& rows, const double* rhs, const double* x, double* r, int m,
                         int first, int count, long begin, long end, double* scratch) const;
  [[noreturn]] void fail(int node, const linalg::Pivot& pivot) const;

  int nodes_, primal_, dual_, width_;
  std::vector<signed char> signs_;  // of two nodes
  FrontSweep down_, up_;
  int root_node_, root_nodes_;  // the first one, and how many
  bool factored_ = false;
  int begun_ = 0;  // columns whose first half kept_down_ and kept_up_ hold
  long root_ld_;
  linalg::BlockBuffer root_, root_inverse_, root_packed_, root_before_, root_coupling_;
  linalg::BlockBuffer kept_down_, kept_up_;                     // of solve()
  linalg::BlockBuffer residual_, saved_, chunk_max_, scratch_;  // of refine()
  const linalg::BlockKernels& kernels_;
  const NodeRowKernels& row_kernels_;
  const RowProductKernels& products_;
};

}  // namespace trajopt
