// linalg::BorderedFactorization on a GPU: factorization and solution with the same bits.
#pragma once

#include "trajopt/cuda/linalg/factorization.h"
#include "trajopt/linalg/group_border.h"

namespace trajopt::cuda {

class BorderedFactorization {
 public:
  BorderedFactorization(int blocks, int size, int border,
                        linalg::Ordering ordering = linalg::Ordering::automatic, int chunks = 2);

  // In device memory. e: rows x border, f: border x border (lower triangle), both row-major and
  // needed again by enqueue_solve; signs: of K's rows, border_signs: of the border's.
  void enqueue_factor(const BlockTridiagonal& k, const double* e, const double* f,
                      const signed char* signs, const signed char* border_signs,
                      const double* regularization, const Stream& stream);
  // In place: z is rows x m, y is border x m, row-major.
  void enqueue_solve(double* z, double* y, int m, const Stream& stream) const;

  // Waits for the stream; throws FactorizationError if the last enqueue_factor failed. The border
  // counts as the block behind the last.
  void check(const signed char* host_signs, const signed char* host_border_signs,
             double regularization, const Stream& stream);

  int blocks() const { return inner_.blocks(); }
  int size() const { return inner_.size(); }
  int border() const { return system_.border; }
  linalg::Ordering ordering() const { return inner_.ordering(); }
  bool factored() const { return factored_; }

 private:
  Factorization inner_;
  linalg::GroupBorder system_;
  DeviceBuffer<double> z_, schur_, unscaled_, inverse_;
  DeviceBuffer<linalg::GroupFailure> failure_;
  PinnedBuffer<linalg::GroupFailure> host_failure_;
  bool factored_ = false;
};

}  // namespace trajopt::cuda
