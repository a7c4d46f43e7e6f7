// linalg::BorderedFactorization on a GPU, or a batch of them, with the same bits.
#pragma once

#include <vector>

#include "trajopt/cuda/linalg/factorization.h"
#include "trajopt/linalg/group_border_refine.h"

namespace trajopt::cuda {

class BorderedFactorization {
 public:
  // reach: as of linalg::BorderedFactorization.
  BorderedFactorization(int blocks, int size, int border,
                        linalg::Ordering ordering = linalg::Ordering::automatic, int chunks = 2,
                        int batch = 1, int reach = 0);

  // In device memory. e: (batch, rows, border), f: (batch, border, border), its lower triangle,
  // both row-major and needed again; signs: (batch, rows), border_signs: (batch, border).
  void enqueue_factor(const BlockTridiagonal& k, const double* e, const double* f,
                      const signed char* signs, const signed char* border_signs,
                      const double* regularization, const Stream& stream);
  // In place: x is (batch, rows + border, m), row-major.
  void enqueue_solve(double* x, int m, const Stream& stream) const;
  // Improves x, with the k, e and f of the last enqueue_factor, which may have been changed since:
  // the regularization taken out. Call reserve_refinement(m) before, outside of any capture.
  void enqueue_refine(const BlockTridiagonal& k, const double* rhs, double* x, int m, int max_steps,
                      double tolerance, const Stream& stream) const;
  void reserve_refinement(int m, const Stream& stream);

  // As Factorization::list.
  void list(const int* listed, int places) { inner_.list(listed, places); }

  // Waits for the stream; throws FactorizationError if the last enqueue_factor failed. The border
  // counts as the block behind the last.
  void check(const signed char* host_signs, const signed char* host_border_signs,
             double regularization, const Stream& stream);
  // By item: kNever, or something else where it failed; in device memory.
  const int* failed_stages() const { return inner_.failed_stages(); }
  // As Factorization::failure, with the signs of this item.
  FactorizationError failure(int item, const signed char* signs, const signed char* border_signs,
                             double regularization, int name, const Stream& stream) const;

  int blocks() const { return inner_.blocks(); }
  int size() const { return inner_.size(); }
  int border() const { return system_.border; }
  int batch() const { return inner_.batch(); }
  linalg::Ordering ordering() const { return inner_.ordering(); }
  bool factored() const { return factored_; }

 private:
  std::vector<linalg::GroupFailure> download_failures(const Stream& stream) const;

  Factorization inner_;
  linalg::GroupBorder system_;
  DeviceBuffer<double> z_, schur_, unscaled_, inverse_;
  DeviceBuffer<linalg::GroupFailure> failures_;
  bool factored_ = false;

  // Of refinement, for refine_columns_ right-hand sides.
  int refine_columns_ = 0;
  DeviceBuffer<double> residual_, saved_, norm_;
  DeviceBuffer<linalg::GroupRefinement> states_;
  DeviceBuffer<int> active_, going_;
};

}  // namespace trajopt::cuda
