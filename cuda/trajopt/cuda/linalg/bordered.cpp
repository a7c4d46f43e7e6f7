#include "trajopt/cuda/linalg/bordered.h"

#include <string>
#include <vector>

#include "trajopt/cuda/base/device.h"
#include "trajopt/cuda/linalg/launches.h"
#include "trajopt/linalg/pivot_error.h"

namespace trajopt::cuda {

using linalg::GroupFailure;

BorderedFactorization::BorderedFactorization(int blocks, int size, int border,
                                             linalg::Ordering ordering, int chunks, int batch,
                                             int reach)
    : inner_(blocks, size, ordering, chunks, batch) {
  if (border < 1) {
    throw ArgumentError("a border needs at least one unknown, not " + std::to_string(border));
  }
  if (reach < 0 || 2 * reach > blocks) {
    throw ArgumentError("a border's reach is at most half of " + std::to_string(blocks) +
                        " blocks, not " + std::to_string(reach));
  }
  const DeviceInfo device = current_device();
  const std::size_t needed = border_shared_memory(size, border);
  if (needed > device.shared_memory) {
    throw DeviceError("a border of " + std::to_string(border) + " needs " + std::to_string(needed) +
                      " bytes of shared memory in a thread block, " + device.name + " has " +
                      std::to_string(device.shared_memory));
  }
  system_.border = border;
  system_.rows = static_cast<long>(blocks) * size;
  system_.reached = reach > 0 ? static_cast<long>(reach) * size : system_.rows;
  system_.ld = linalg::group_ld(border);
  const std::size_t items = batch, block = system_.block_length();
  z_ = DeviceBuffer<double>(items * system_.rows * border);
  schur_ = DeviceBuffer<double>(items * block);
  unscaled_ = DeviceBuffer<double>(items * block);
  inverse_ = DeviceBuffer<double>(items * border);
  failures_ = DeviceBuffer<GroupFailure>(items);
  load_border_kernels();
  system_.z = z_.data();
  system_.schur = schur_.data();
  system_.unscaled = unscaled_.data();
  system_.inverse = inverse_.data();
  system_.failures = failures_.data();
}

void BorderedFactorization::enqueue_factor(const BlockTridiagonal& k, const double* e,
                                           const double* f, const signed char* signs,
                                           const signed char* border_signs,
                                           const double* regularization, const Stream& stream) {
  system_.e = e;
  system_.f = f;
  system_.signs = border_signs;
  system_.regularization = regularization;
  failures_.set_bytes(0xff, stream);  // block -1
  inner_.enqueue_factor(k, signs, regularization, stream);
  launch_border_factor(inner_.plan(), inner_.entries(), inner_.system(), system_, stream);
}

void BorderedFactorization::check(const signed char* host_signs,
                                  const signed char* host_border_signs, double regularization,
                                  const Stream& stream) {
  factored_ = false;
  inner_.check(host_signs, regularization, stream);
  const std::vector<GroupFailure> failures = download_failures(stream);
  for (int item = 0; item < batch(); ++item) {
    if (failures[item].block < 0) continue;
    const long at = static_cast<long>(item) * border();
    throw failure(item, nullptr, host_border_signs ? host_border_signs + at : nullptr,
                  regularization, batch() > 1 ? item : -1, stream);
  }
  factored_ = true;
}

std::vector<GroupFailure> BorderedFactorization::download_failures(const Stream& stream) const {
  std::vector<GroupFailure> failures(batch());
  failures_.download(failures.data(), failures.size(), stream);
  stream.synchronize();
  return failures;
}

FactorizationError BorderedFactorization::failure(int item, const signed char* signs,
                                                  const signed char* border_signs,
                                                  double regularization, int name,
                                                  const Stream& stream) const {
  const GroupFailure f = download_failures(stream)[item];
  if (f.block < 0) return inner_.failure(item, signs, regularization, name, stream);
  const bool positive = !border_signs || border_signs[f.row] > 0;
  return linalg::border_pivot_error(name, blocks(), f.row, f.value, positive, regularization);
}

void BorderedFactorization::enqueue_solve(double* x, int m, const Stream& stream) const {
  if (m < 1) return;
  launch_border_solve(inner_.plan(), inner_.entries(), inner_.system(), system_, x, m, stream);
}

void BorderedFactorization::reserve_refinement(int m, const Stream& stream) {
  if (m <= refine_columns_) return;
  const std::size_t items = batch(), values = items * system_.stride(m);
  refine_columns_ = 0;
  residual_ = DeviceBuffer<double>(values);
  saved_ = DeviceBuffer<double>(values);
  norm_ = DeviceBuffer<double>(items * m);
  states_ = DeviceBuffer<linalg::GroupRefinement>(items * m);
  active_ = DeviceBuffer<int>(items * m);
  going_ = DeviceBuffer<int>(items * linalg::column_chunks(m));
  norm_.set_zero(stream);  // every refinement leaves zeros
  stream.synchronize();
  refine_columns_ = m;
}

void BorderedFactorization::enqueue_refine(const BlockTridiagonal& k, const double* rhs, double* x,
                                           int m, int max_steps, double tolerance,
                                           const Stream& stream) const {
  if (m > refine_columns_) {
    throw ArgumentError("enqueue_refine: " + std::to_string(m) + " columns, reserved are " +
                        std::to_string(refine_columns_));
  }
  const linalg::BorderRefineArrays arrays{rhs,          residual_.data(), saved_.data(),
                                          norm_.data(), states_.data(),   active_.data(),
                                          going_.data()};
  launch_border_refine(inner_.plan(), inner_.entries(), inner_.system_of(k), system_, x, m,
                       max_steps, tolerance, arrays, stream);
}

}  // namespace trajopt::cuda
