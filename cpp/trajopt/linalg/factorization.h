// Signed block factorization A = Wt D W of a symmetric block tridiagonal matrix: Cholesky's flops,
// no square roots, no pivoting. The signs of D are known beforehand for definite and quasi-definite
// matrices (an optimizer's KKT system); a pivot of another sign is an error, so a factorization
// that succeeds has verified the inertia.
#pragma once

#include <memory>
#include <vector>

#include "trajopt/base/isa.h"
#include "trajopt/linalg/block_buffer.h"
#include "trajopt/linalg/block_tridiagonal.h"
#include "trajopt/linalg/factors.h"
#include "trajopt/linalg/precision.h"
#include "trajopt/linalg/refinement.h"
#include "trajopt/linalg/schedule.h"

namespace trajopt::linalg {

class Factorization {
 public:
  // Allocates everything factor(), solve() and refine() need; throws MemoryError.
  //   chunks   sweeps of Ordering::chunked; 2 costs no more than the sequential sweep
  //   isa      instruction set of the kernels; lowered to what the machine has
  Factorization(int blocks, int size, Ordering ordering = Ordering::automatic, int chunks = 2,
                int batch = 1, Isa isa = Isa::avx512, Precision precision = Precision::float64);

  // Factors A + regularization * diag(signs).
  //   signs    (batch, blocks * size) of +1 and -1, nullptr: all +1
  // Throws FactorizationError, naming block and pivot, when a pivot is not finite, is zero to
  // working accuracy or has the wrong sign.
  void factor(const SymmetricBlockTridiagonal& a, const signed char* signs = nullptr,
              double regularization = 0.0, int threads = 1);

  // The same, but false at such a pivot: for callers who expect failures. Allocates nothing.
  [[nodiscard]] bool try_factor(const SymmetricBlockTridiagonal& a,
                                const signed char* signs = nullptr, double regularization = 0.0,
                                int threads = 1);

  // Solves in place; rhs is (batch, blocks * size, m), row-major. solve_item takes one problem.
  // float32 factors solve in float32: refine afterwards.
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
  Ordering ordering() const { return schedule_->ordering; }  // never automatic
  Precision precision() const { return double_ ? Precision::float64 : Precision::float32; }
  bool factored() const { return factored_; }

 private:
  static constexpr int kColumnsAtOnce = 8;  // refined, or converted to float32 and back

  int useful_threads(int threads) const;
  void solve_in_single(int item, double* rhs, int m, int threads) const;
  [[noreturn]] void fail(int item, const PivotFailure& failure, const signed char* signs,
                         double regularization) const;
  Refinement refine_item(const SymmetricBlockTridiagonal& a, int item, const double* rhs, double* x,
                         int m, int max_steps, double tolerance, int threads);

  int blocks_, size_, batch_;
  std::unique_ptr<const Schedule> schedule_;
  std::unique_ptr<Factors<double>> double_;  // one of the two
  std::unique_ptr<Factors<float>> single_;
  BlockBuffer residual_, saved_;     // of refine(), for kColumnsAtOnce columns
  BlockBuffer magnitudes_;           // one per block
  BasicBlockBuffer<float> columns_;  // of solve() with float32 factors, for each problem
  bool factored_ = false;
};

}  // namespace trajopt::linalg
