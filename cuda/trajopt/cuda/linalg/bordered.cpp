#include "trajopt/cuda/linalg/bordered.h"

#include <string>

#include "trajopt/cuda/base/device.h"
#include "trajopt/cuda/linalg/launches.h"
#include "trajopt/linalg/pivot_error.h"

namespace trajopt::cuda {

BorderedFactorization::BorderedFactorization(int blocks, int size, int border,
                                             linalg::Ordering ordering, int chunks)
    : inner_(blocks, size, ordering, chunks) {
  if (border < 1) {
    throw ArgumentError("a border needs at least one unknown, not " + std::to_string(border));
  }
  const DeviceInfo device = current_device();
  const std::size_t needed = border_shared_memory(border);
  if (needed > device.shared_memory) {
    throw DeviceError("a border of " + std::to_string(border) + " needs " + std::to_string(needed) +
                      " bytes of shared memory in a thread block, " + device.name + " has " +
                      std::to_string(device.shared_memory));
  }
  system_.border = border;
  system_.rows = static_cast<long>(blocks) * size;
  system_.ld = linalg::group_ld(border);
  z_ = DeviceBuffer<double>(static_cast<std::size_t>(system_.rows) * border);
  schur_ = DeviceBuffer<double>(system_.ld * border);
  unscaled_ = DeviceBuffer<double>(system_.ld * border);
  inverse_ = DeviceBuffer<double>(border);
  failure_ = DeviceBuffer<linalg::GroupFailure>(1);
  load_border_kernels();
  host_failure_ = PinnedBuffer<linalg::GroupFailure>(1);
  system_.z = z_.data();
  system_.schur = schur_.data();
  system_.unscaled = unscaled_.data();
  system_.inverse = inverse_.data();
  system_.failure = failure_.data();
  system_.failed_item = inner_.failed_item();
}

void BorderedFactorization::enqueue_factor(const BlockTridiagonal& k, const double* e,
                                           const double* f, const signed char* signs,
                                           const signed char* border_signs,
                                           const double* regularization, const Stream& stream) {
  system_.e = e;
  system_.f = f;
  system_.signs = border_signs;
  system_.regularization = regularization;
  failure_.set_bytes(0xff, stream);  // block -1
  inner_.enqueue_factor(k, signs, regularization, stream);
  TRAJOPT_CUDA_CHECK(
      cudaMemcpyAsync(z_.data(), e, z_.bytes(), cudaMemcpyDeviceToDevice, stream.get()));
  inner_.enqueue_solve(z_.data(), border(), stream);
  launch_border_factor(system_, stream);
}

void BorderedFactorization::check(const signed char* host_signs,
                                  const signed char* host_border_signs, double regularization,
                                  const Stream& stream) {
  factored_ = false;
  inner_.check(host_signs, regularization, stream);
  failure_.download(host_failure_.data(), 1, stream);
  stream.synchronize();
  const linalg::GroupFailure& failure = host_failure_[0];
  if (failure.block >= 0) {
    const bool positive = !host_border_signs || host_border_signs[failure.row] > 0;
    throw linalg::border_pivot_error(blocks(), failure.row, failure.value, positive,
                                     regularization);
  }
  factored_ = true;
}

void BorderedFactorization::enqueue_solve(double* z, double* y, int m, const Stream& stream) const {
  if (m < 1) return;
  inner_.enqueue_solve(z, m, stream);
  launch_border_solve(system_, size(), z, y, m, stream);
}

}  // namespace trajopt::cuda
