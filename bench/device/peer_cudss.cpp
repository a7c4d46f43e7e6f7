// The same single systems with cuDSS, the vendor's sparse direct solver: refactorization (analysis
// and ordering are done before) and solution, positive definite, lower triangle in CSR.
//
//   peer_cudss [SECONDS]      rows of JSON
#include <cudss.h>

#include <cstdint>
#include <cstdlib>
#include <limits>

#include "device/systems.h"
#include "device/timing.h"
#include "trajopt/base/error.h"
#include "trajopt/cuda/base/buffer.h"
#include "trajopt/cuda/base/device.h"

namespace trajopt::bench {
namespace {

void check(cudssStatus_t status, const char* call) {
  if (status != CUDSS_STATUS_SUCCESS) {
    throw DeviceError(std::string(call) + " failed: status " + std::to_string(status));
  }
}
#define CHECK(call) check((call), #call)

struct Csr {
  std::vector<int> begin, column;
  std::vector<double> value;
};

Csr lower_triangle(const linalg::SymmetricBlockTridiagonal& a) {
  const int n = a.size();
  const double entries = static_cast<double>(a.blocks()) * n * (1.5 * n + 1.0);
  if (entries > std::numeric_limits<int>::max()) {
    throw ArgumentError("more entries than 32-bit indices can count");
  }
  Csr m;
  m.begin.push_back(0);
  const auto add = [&](int column, double value) {
    m.column.push_back(column);
    m.value.push_back(value);
  };
  for (int i = 0; i < a.blocks(); ++i) {
    for (int r = 0; r < n; ++r) {
      for (int c = 0; i > 0 && c < n; ++c) add((i - 1) * n + c, a.lower(i - 1)[r * n + c]);
      for (int c = 0; c <= r; ++c) add(i * n + c, a.diagonal(i)[r * n + c]);
      m.begin.push_back(static_cast<int>(m.column.size()));
    }
  }
  return m;
}

class Solver {
 public:
  explicit Solver(const linalg::SymmetricBlockTridiagonal& a) : rows_(a.rows()) {
    const Csr m = lower_triangle(a);
    const std::vector<double> host = ramp(rows_);
    begin_ = cuda::DeviceBuffer<int>(m.begin.size());
    column_ = cuda::DeviceBuffer<int>(m.column.size());
    value_ = cuda::DeviceBuffer<double>(m.value.size());
    rhs_ = cuda::DeviceBuffer<double>(rows_);
    x_ = cuda::DeviceBuffer<double>(rows_);
    begin_.upload(m.begin.data(), m.begin.size(), stream_);
    column_.upload(m.column.data(), m.column.size(), stream_);
    value_.upload(m.value.data(), m.value.size(), stream_);
    rhs_.upload(host.data(), host.size(), stream_);
    stream_.synchronize();
    CHECK(cudssCreate(&handle_));
    CHECK(cudssSetStream(handle_, stream_.get()));
    CHECK(cudssConfigCreate(&config_));
    CHECK(cudssDataCreate(handle_, &data_));
    CHECK(cudssMatrixCreateCsr(&matrix_, rows_, rows_, static_cast<std::int64_t>(m.value.size()),
                               begin_.data(), nullptr, column_.data(), value_.data(), CUDA_R_32I,
                               CUDA_R_32I, CUDA_R_64F, CUDSS_MTYPE_SPD, CUDSS_MVIEW_LOWER,
                               CUDSS_BASE_ZERO));
    CHECK(
        cudssMatrixCreateDn(&b_, rows_, 1, rows_, rhs_.data(), CUDA_R_64F, CUDSS_LAYOUT_COL_MAJOR));
    CHECK(cudssMatrixCreateDn(&solution_, rows_, 1, rows_, x_.data(), CUDA_R_64F,
                              CUDSS_LAYOUT_COL_MAJOR));
    execute(CUDSS_PHASE_ANALYSIS);
    execute(CUDSS_PHASE_FACTORIZATION);
    stream_.synchronize();
  }
  ~Solver() {  // what was not created is null
    if (solution_) cudssMatrixDestroy(solution_);
    if (b_) cudssMatrixDestroy(b_);
    if (matrix_) cudssMatrixDestroy(matrix_);
    if (data_) cudssDataDestroy(handle_, data_);
    if (config_) cudssConfigDestroy(config_);
    if (handle_) cudssDestroy(handle_);
  }
  Solver(const Solver&) = delete;
  Solver& operator=(const Solver&) = delete;

  void execute(int phase) {
    CHECK(cudssExecute(handle_, phase, config_, data_, matrix_, solution_, b_));
  }
  std::vector<double> solution() {
    std::vector<double> x(rows_);
    x_.download(x.data(), x.size(), stream_);
    stream_.synchronize();
    return x;
  }
  const cuda::Stream& stream() const { return stream_; }

 private:
  std::int64_t rows_;
  cuda::Stream stream_;
  cuda::DeviceBuffer<int> begin_, column_;
  cuda::DeviceBuffer<double> value_, rhs_, x_;
  cudssHandle_t handle_ = nullptr;
  cudssConfig_t config_ = nullptr;
  cudssData_t data_ = nullptr;
  cudssMatrix_t matrix_ = nullptr, b_ = nullptr, solution_ = nullptr;
};

double residual(const linalg::SymmetricBlockTridiagonal& a, const std::vector<double>& x) {
  const std::vector<double> rhs = ramp(x.size());
  std::vector<double> product(x.size());
  a.matmul(x.data(), product.data(), 1);
  double worst = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    worst = std::max(worst, std::abs(rhs[i] - product[i]));
  }
  return worst;
}

int run(double seconds) {
  for (const Shape& shape : shapes()) {
    if (shape.batch != 1) continue;
    Row row;
    row.text("program", "peer").text("peer", "cuDSS");
    row.number("blocks", shape.blocks).number("size", shape.size).number("batch", 1);
    try {
      linalg::SymmetricBlockTridiagonal a(shape.blocks, shape.size);
      fill(a, nullptr);
      Solver solver(a);
      const auto time = [&](int phase) {
        return time_gpu(seconds, solver.stream(), [&] { solver.execute(phase); });
      };
      row.timing("gpu_factor", time(CUDSS_PHASE_REFACTORIZATION));
      row.timing("gpu_solve", time(CUDSS_PHASE_SOLVE));
      row.number("residual", residual(a, solver.solution()));
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
