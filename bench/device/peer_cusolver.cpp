// The same systems with the vendor's dense libraries: block Thomas, a batch at a time, from batched
// Cholesky (cusolverDnDpotrfBatched), triangular solution (cublasDtrsmBatched) and products
// (cublasDgemmStridedBatched). Positive definite systems only; factorization only.
//
//   peer_cusolver [SECONDS]      rows of JSON
#include <cublas_v2.h>
#include <cusolverDn.h>

#include <cstdlib>

#include "device/systems.h"
#include "device/timing.h"
#include "trajopt/base/error.h"
#include "trajopt/cuda/base/device.h"
#include "trajopt/cuda/linalg/block_tridiagonal.h"

namespace trajopt::bench {
namespace {

void check(cublasStatus_t status, const char* call) {
  if (status != CUBLAS_STATUS_SUCCESS) {
    throw DeviceError(std::string(call) + " failed: " + cublasGetStatusString(status));
  }
}
void check(cusolverStatus_t status, const char* call) {
  if (status != CUSOLVER_STATUS_SUCCESS) {
    throw DeviceError(std::string(call) + " failed: status " + std::to_string(status));
  }
}
#define CHECK(call) check((call), #call)

// A row-major lower triangle is a column-major upper one: A_i = U_i^t U_i, and the coupling
// L_i = A[i+1, i], seen column-major, is its transpose: U_i^-t L_i^t is one triangular solution
// from the left, and A_{i+1} -= (that)^t (that).
class BlockThomas {
 public:
  explicit BlockThomas(const linalg::SymmetricBlockTridiagonal& a)
      : blocks_(a.blocks()), n_(a.size()), batch_(a.batch()), matrix_(blocks_, n_, batch_) {
    CHECK(cublasCreate(&blas_));
    CHECK(cusolverDnCreate(&solver_));
    CHECK(cublasSetStream(blas_, stream_.get()));
    CHECK(cusolverDnSetStream(solver_, stream_.get()));
    matrix_.upload(a, stream_);
    const std::size_t block = static_cast<std::size_t>(n_) * n_;
    diagonal_ = cuda::DeviceBuffer<double>(block * blocks_ * batch_);
    lower_ = cuda::DeviceBuffer<double>(block * (blocks_ - 1) * batch_);
    info_ = cuda::DeviceBuffer<int>(batch_);
    std::vector<double*> d, l;
    for (int i = 0; i < blocks_; ++i) {
      for (int item = 0; item < batch_; ++item) {
        d.push_back(diagonal_.data() + (static_cast<std::size_t>(item) * blocks_ + i) * block);
        l.push_back(lower_.data() + (static_cast<std::size_t>(item) * (blocks_ - 1) + i) * block);
      }
    }
    diagonals_ = cuda::DeviceBuffer<double*>(d.size());
    lowers_ = cuda::DeviceBuffer<double*>(l.size());
    diagonals_.upload(d.data(), d.size(), stream_);
    lowers_.upload(l.data(), l.size(), stream_);
    stream_.synchronize();
  }
  ~BlockThomas() {
    cublasDestroy(blas_);
    cusolverDnDestroy(solver_);
  }
  BlockThomas(const BlockThomas&) = delete;
  BlockThomas& operator=(const BlockThomas&) = delete;

  void restore() {
    const std::size_t d = diagonal_.bytes(), l = lower_.bytes();
    TRAJOPT_CUDA_CHECK(cudaMemcpyAsync(diagonal_.data(), matrix_.diagonal(), d,
                                       cudaMemcpyDeviceToDevice, stream_.get()));
    if (l == 0) return;
    TRAJOPT_CUDA_CHECK(cudaMemcpyAsync(lower_.data(), matrix_.lower(), l, cudaMemcpyDeviceToDevice,
                                       stream_.get()));
  }

  void factor() {
    const double one = 1.0, minus_one = -1.0;
    const std::size_t block = static_cast<std::size_t>(n_) * n_;
    for (int i = 0; i < blocks_; ++i) {
      const std::size_t at = static_cast<std::size_t>(i) * batch_;
      CHECK(cusolverDnDpotrfBatched(solver_, CUBLAS_FILL_MODE_UPPER, n_, diagonals_.data() + at, n_,
                                    info_.data(), batch_));
      if (i + 1 == blocks_) break;
      CHECK(cublasDtrsmBatched(blas_, CUBLAS_SIDE_LEFT, CUBLAS_FILL_MODE_UPPER, CUBLAS_OP_T,
                               CUBLAS_DIAG_NON_UNIT, n_, n_, &one, diagonals_.data() + at, n_,
                               lowers_.data() + at, n_, batch_));
      double* v = lower_.data() + block * i;
      CHECK(cublasDgemmStridedBatched(blas_, CUBLAS_OP_T, CUBLAS_OP_N, n_, n_, n_, &minus_one, v,
                                      n_, block * (blocks_ - 1), v, n_, block * (blocks_ - 1), &one,
                                      diagonal_.data() + block * (i + 1), n_, block * blocks_,
                                      batch_));
    }
  }

  // The last block's pivots are positive only if all went well.
  bool good() {
    std::vector<int> info(batch_);
    info_.download(info.data(), info.size(), stream_);
    stream_.synchronize();
    return std::all_of(info.begin(), info.end(), [](int i) { return i == 0; });
  }
  const cuda::Stream& stream() const { return stream_; }

 private:
  int blocks_, n_, batch_;
  cuda::Stream stream_;
  cuda::BlockTridiagonal matrix_;
  cuda::DeviceBuffer<double> diagonal_, lower_;
  cuda::DeviceBuffer<double*> diagonals_, lowers_;
  cuda::DeviceBuffer<int> info_;
  cublasHandle_t blas_ = nullptr;
  cusolverDnHandle_t solver_ = nullptr;
};

Timing measure(BlockThomas& thomas, double seconds) {
  const cuda::Event begin, end;
  return repeat(seconds, [&] {
    thomas.restore();
    begin.record(thomas.stream());
    thomas.factor();
    end.record(thomas.stream());
    end.synchronize();
    return cuda::elapsed_ms(begin, end);
  });
}

int run(double seconds) {
  for (const Shape& shape : shapes()) {
    Row row;
    row.text("program", "peer").text("peer", "cuSOLVER + cuBLAS batched block Thomas");
    row.number("blocks", shape.blocks).number("size", shape.size).number("batch", shape.batch);
    try {
      linalg::SymmetricBlockTridiagonal a(shape.blocks, shape.size, shape.batch);
      fill(a, nullptr);
      BlockThomas thomas(a);
      row.timing("gpu_factor", measure(thomas, seconds));
      row.flag("positive_definite", thomas.good());
    } catch (const std::exception& error) {
      row.text("left_out", error.what());
    }
    row.print(stdout);
  }
  return 0;
}

}  // namespace
}  // namespace trajopt::bench

int main(int argc, char** argv) {
  try {
    trajopt::cuda::require_device();
    return trajopt::bench::run(argc > 1 ? std::atof(argv[1]) : 0.3);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
