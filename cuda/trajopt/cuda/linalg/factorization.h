// linalg::Factorization on a GPU, with the same bits for the same ordering.
//
// Two interfaces. The one of the CPU class takes matrices and vectors in host memory and returns
// when the work is done. The other, enqueue_*, puts the launches into a stream (or a graph that is
// being captured) and leaves everything in device memory; check() asks afterwards whether the
// factorization succeeded.
#pragma once

#include <variant>

#include "trajopt/cuda/base/buffer.h"
#include "trajopt/cuda/base/device.h"
#include "trajopt/cuda/base/stream.h"
#include "trajopt/cuda/linalg/block_tridiagonal.h"
#include "trajopt/cuda/linalg/factors.h"
#include "trajopt/linalg/group_sequence.h"
#include "trajopt/linalg/precision.h"
#include "trajopt/linalg/refinement.h"

namespace trajopt::cuda {

class Factorization {
 public:
  // Allocates everything factor() needs on the current device; DeviceError when it is not there.
  // Ordering::automatic is cyclic for few problems and, where there are enough problems to fill the
  // device, two sweeps each, which need a third of the flops.
  Factorization(int blocks, int size, linalg::Ordering ordering = linalg::Ordering::automatic,
                int chunks = 2, int batch = 1,
                linalg::Precision precision = linalg::Precision::float64);

  // As linalg::Factorization. solve() and refine() keep their buffers for the next call.
  void factor(const linalg::SymmetricBlockTridiagonal& a, const signed char* signs = nullptr,
              double regularization = 0.0);
  void solve(double* rhs, int m = 1);
  linalg::Refinement refine(const linalg::SymmetricBlockTridiagonal& a, const double* rhs,
                            double* x, int m, int max_steps, double tolerance);

  // In device memory: the matrix, its signs (batch, blocks * size) and one regularization. All of
  // them must live as long as the work that reads them; refinement reads the matrix again.
  void enqueue_factor(const BlockTridiagonal& a, const signed char* signs,
                      const double* regularization, const Stream& stream);
  // x: (batch, blocks * size, m), in place. With float32 factors call reserve_solution(m) before,
  // outside of any capture: a graph that was captured before a larger reservation is void.
  void enqueue_solve(double* x, int m, const Stream& stream) const;
  void reserve_solution(int m);
  // Improves x. Call reserve_refinement(m) before, likewise; it reserves for solutions too.
  void enqueue_refine(const BlockTridiagonal& a, const double* rhs, double* x, int m, int max_steps,
                      double tolerance, const Stream& stream) const;
  void reserve_refinement(int m);

  // The launches enqueued from here on are for listed[0] problems of the batch, those in listed[1]
  // on, and have room for `places` of them. In device memory, read when the launches run.
  void list(const int* listed, int places);

  // Waits for the stream; throws FactorizationError, as linalg::Factorization::factor does, if the
  // last enqueue_factor failed. `signs` and `regularization` are for the message.
  void check(const signed char* host_signs, double regularization, const Stream& stream);
  // Waits for the stream; the result of the last enqueue_refine.
  linalg::Refinement refinement(const Stream& stream) const;
  // By item: kNever, or the stage in which it failed; in device memory.
  const int* failed_stages() const { return failed_stage_.data(); }
  // Of an item that failed: what check() would throw, with `signs` those of this item and the
  // item's name `name` (-1: it has none).
  FactorizationError failure(int item, const signed char* signs, double regularization, int name,
                             const Stream& stream) const;

  int blocks() const { return shape_.blocks; }
  int size() const { return shape_.size; }
  int batch() const { return batch_; }
  linalg::Precision precision() const {
    return factors_.index() == 0 ? linalg::Precision::float64 : linalg::Precision::float32;
  }
  linalg::Ordering ordering() const { return plan_.ordering; }  // never automatic
  bool factored() const { return factored_; }
  std::size_t device_bytes() const;  // of all buffers

  // For launches that go with these: what they work on, without or with the matrix. The factors
  // are those in float64.
  const linalg::GroupPlan& plan() const { return plan_; }
  linalg::PlanEntries entries() const { return {eliminations_.data(), updates_.data()}; }
  linalg::GroupSystem system() const;
  linalg::GroupSystem system_of(const BlockTridiagonal& a) const;

 private:
  long rows() const { return static_cast<long>(blocks()) * size(); }
  template <class T>
  Factors<T> make_factors(const DeviceInfo& device) const;
  template <class T>
  linalg::BasicGroupSystem<T> complete(const Factors<T>& factors,
                                       const linalg::GroupMatrix& a) const;
  // body(system) with the factors and the matrices `a`.
  template <class Body>
  void with_system(const linalg::GroupMatrix& a, const Body& body) const;
  linalg::GroupMatrix matrix_of(const BlockTridiagonal& a) const;
  linalg::GroupRounding room() const { return {rounded_.data(), peak_.data(), scale_.data()}; }
  linalg::RefineArrays refine_arrays(const double* rhs) const;
  void upload(const linalg::SymmetricBlockTridiagonal& a, const char* what);
  void reserve_columns(int m);
  bool refinement_goes_on();
  void require_factors(const char* what) const;

  linalg::GroupPlan plan_;
  int batch_ = 1;
  linalg::GroupMatrix shape_;  // without a matrix; its batch and items are those of the launches
  DeviceBuffer<linalg::PlannedElimination> eliminations_;
  DeviceBuffer<linalg::PlannedUpdate> updates_;
  std::variant<Factors<double>, Factors<float>> factors_;
  DeviceBuffer<linalg::GroupFailure> failures_;
  DeviceBuffer<int> failed_stage_, failed_item_;
  bool factored_ = false;

  // Of the host interface: a place for the matrix, and the factorization as a graph.
  Stream stream_;
  BlockTridiagonal matrix_;
  DeviceBuffer<signed char> signs_;
  DeviceBuffer<double> regularization_;
  PinnedBuffer<double> host_regularization_;
  PinnedBuffer<int> host_failed_item_;
  Graph factor_graph_, solve_graph_;
  int solve_graph_columns_ = 0;
  DeviceBuffer<double> x_, rhs_;

  // Of solutions with float32 factors, for solve_columns_ right-hand sides.
  int solve_columns_ = 0;
  DeviceBuffer<float> rounded_;
  DeviceBuffer<double> peak_, scale_;

  // Of refinement, for refine_columns_ right-hand sides.
  int refine_columns_ = 0;
  mutable long lanes_ = 0;  // of the last enqueue_refine
  DeviceBuffer<double> residual_, saved_, norm_;
  DeviceBuffer<linalg::GroupRefinement> states_;
  DeviceBuffer<int> active_;
};

}  // namespace trajopt::cuda
