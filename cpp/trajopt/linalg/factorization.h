// Signed block factorization A = Wt D W of a symmetric block tridiagonal matrix: Cholesky's flops,
// no square roots, no pivoting. The signs of D are known beforehand for definite and quasi-definite
// matrices (an optimizer's KKT system); a pivot of another sign is an error, so a factorization
// that succeeds has verified the inertia.
#pragma once

#include <vector>

#include "trajopt/base/isa.h"
#include "trajopt/linalg/block_buffer.h"
#include "trajopt/linalg/block_kernels.h"
#include "trajopt/linalg/block_tridiagonal.h"
#include "trajopt/linalg/refinement.h"
#include "trajopt/linalg/schedule.h"

namespace trajopt::linalg {

class Factorization {
 public:
  // Allocates everything factor(), solve() and refine() need.
  //   chunks   sweeps of Ordering::chunked; 2 costs no more than the sequential sweep
  //   isa      instruction set of the kernels; lowered to what the machine has
  Factorization(int blocks, int size, Ordering ordering = Ordering::automatic, int chunks = 2,
                int batch = 1, Isa isa = Isa::avx512);

  // Factors A + regularization * diag(signs).
  //   signs    (batch, blocks * size) of +1 and -1, nullptr: all +1
  // Throws FactorizationError, naming block and pivot, when a pivot is not finite, is zero to
  // working accuracy or has the wrong sign.
  void factor(const SymmetricBlockTridiagonal& a, const signed char* signs = nullptr,
              double regularization = 0.0, int threads = 1);

  // Solves in place; rhs is (batch, blocks * size, m), row-major. solve_item takes one problem.
  void solve(double* rhs, int m = 1, int threads = 1) const;
  void solve_item(int item, double* rhs, int m, int threads = 1) const;

  // Improves x, the solution found with a regularized factorization, towards A x = rhs. Stops when
  // the residual is below `tolerance`, no longer halves (a step that doubled it is taken back),
  // or after max_steps.
  Refinement refine(const SymmetricBlockTridiagonal& a, const double* rhs, double* x, int m,
                    int max_steps, double tolerance, int threads = 1);

  int blocks() const { return blocks_; }
  int size() const { return size_; }
  int batch() const { return batch_; }
  Ordering ordering() const { return schedule_.ordering; }  // never automatic
  bool factored() const { return factored_; }

 private:
  static constexpr int kRefineColumns = 8;  // refined at a time

  struct Failure {
    int block = -1;  // -1: none
    Pivot pivot;
  };

  Failure factor_item(const SymmetricBlockTridiagonal& a, int item, const signed char* signs,
                      double regularization, int threads, int worker);
  Pivot eliminate(const SymmetricBlockTridiagonal& a, int item, const Step& step,
                  const signed char* signs, double regularization, int run_slot, int worker);
  void update_neighbour(const SymmetricBlockTridiagonal& a, int item, const Step& step, bool left,
                        int run_slot, int worker);
  void forward(int item, const Step& step, double* x, int m) const;
  void backward(int item, const Step& step, double* x, int m) const;
  int useful_threads(int threads) const;
  [[noreturn]] void fail(int item, const Failure& failure, const signed char* signs,
                         double regularization) const;
  Refinement refine_item(const SymmetricBlockTridiagonal& a, int item, const double* rhs, double* x,
                         int m, int max_steps, double tolerance, int threads);

  double* w(int item, int block) const;
  double* coupling(int item, int slot) const;
  double* scratch(int worker, int run_slot, int which) const;

  int blocks_, size_, batch_;
  long ld_, block_;  // leading dimension and length of an internal block
  Schedule schedule_;
  const BlockKernels* kernels_;
  std::vector<int> left_slot_, right_slot_;  // storage of a block's coupling to each neighbour
  int slots_ = 0, run_slots_ = 0, workers_ = 1;
  BlockBuffer w_, couplings_, inverse_, scratch_;
  BlockBuffer residual_, saved_;   // of refine(), for kRefineColumns columns
  std::vector<Failure> failures_;  // one per run of a stage, or per item of a batch
  bool factored_ = false;
};

}  // namespace trajopt::linalg
