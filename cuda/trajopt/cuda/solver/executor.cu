// FramesExecutor with CUDA memory, launches and graphs. What the launches compute stands in
// cpp/trajopt.

// What follows `if constexpr (...) return` is unreachable, and what only the other branch uses
// unused, in one of two instantiations.
#ifdef __CUDACC__
#pragma nv_diag_suppress 128, 177
#endif

#include <optional>
#include <string>
#include <vector>

#include "trajopt/cuda/base/buffer.h"
#include "trajopt/cuda/base/device.h"
#include "trajopt/cuda/base/launch.cuh"
#include "trajopt/cuda/linalg/bordered.h"
#include "trajopt/cuda/solver/executor.h"
#include "trajopt/solver/frames_executor.h"

namespace trajopt::cuda {

namespace {

class CudaDevice {
 public:
  using Recording = Graph;
  class Solver;

  CudaDevice() : shared_((require_device(), std::make_shared<Shared>())) {
    load_all<FramesWork<false>, FramesWork<true>, FoldChunksWork<PointItems>,
             FoldChunksWork<StepItems>, FoldRestWork, PackFramesWork, CallbackCostWork,
             CallbackDerivativesWork, AssembleWork, NodesWork<GatherGradient>,
             NodesWork<WriteStepsRhs>, NodesWork<MeasureSteps>, NodesWork<ComposeStep>,
             NodesWork<WriteCorrectionRhs>, NodesWork<ApplyCorrection>, NodesWork<AcceptTrial>,
             NodesWork<RemoveEpsilon>, NodesWork<SplineFrames<false>>,
             NodesWork<SplineFrames<true>>, NodesWork<SplineRotations>,
             NodesWork<ReduceConstraint<false>>, NodesWork<ReduceConstraint<true>>,
             NodesWork<ReduceGradient>, AssembleSplineWork>();
  }

  const Stream& stream() const { return shared_->stream; }

  DeviceBuffer<unsigned char> allocate(std::size_t bytes) const {
    return DeviceBuffer<unsigned char>(bytes);
  }
  template <class T>
  T* pinned(std::size_t count) const {
    shared_->pinned.emplace_back(count * sizeof(T));
    return reinterpret_cast<T*>(shared_->pinned.back().data());
  }
  void upload(void* to, const void* from, std::size_t bytes) const {
    copy(to, from, bytes, cudaMemcpyHostToDevice);
    stream().synchronize();
  }
  void download(void* to, const void* from, std::size_t bytes) const {
    copy(to, from, bytes, cudaMemcpyDeviceToHost);
    stream().synchronize();
  }
  void copy_in(void* to, const void* from, std::size_t bytes) const {
    copy(to, from, bytes, cudaMemcpyHostToDevice);
  }
  void copy_out(void* to, const void* from, std::size_t bytes) const {
    copy(to, from, bytes, cudaMemcpyDeviceToHost);
  }
  template <class Work>
  void operator()(const Work& work) const {
    launch(work, stream());
  }
  template <class Enqueue>
  Graph record(const Enqueue& enqueue) const {
    return Graph::capture(stream(), enqueue);
  }
  void play(const Graph& graph) const {
    graph.launch(stream());
    stream().synchronize();
  }

 private:
  struct Shared {
    Stream stream;
    std::vector<PinnedBuffer<unsigned char>> pinned;
  };

  template <class... Works>
  static void load_all() {
    (load<Works>(), ...);
  }
  void copy(void* to, const void* from, std::size_t bytes, cudaMemcpyKind kind) const {
    if (bytes == 0) return;
    TRAJOPT_CUDA_CHECK(cudaMemcpyAsync(to, from, bytes, kind, stream().get()));
  }

  std::shared_ptr<Shared> shared_;
};

// Of a ring, the last block is a border of the others.
class CudaDevice::Solver {
 public:
  Solver(const CudaDevice& device, int blocks, int size, linalg::Ordering ordering,
         const std::vector<signed char>& signs, int batch, bool ring)
      : device_(device),
        chain_(ring ? blocks - 1 : blocks),
        matrix_(chain_, size, batch),
        host_signs_(signs.begin(), signs.begin() + rows()),
        host_border_signs_(signs.begin() + rows(), signs.end()),
        regularization_(1) {
    const Stream& stream = device_.stream();
    const std::size_t square = static_cast<std::size_t>(size) * size * batch;
    set_zero(matrix_.diagonal(), square * chain_);
    set_zero(matrix_.lower(), square * (chain_ - 1));
    if (ring) {
      ring_.emplace(chain_, size, size, ordering, 2, batch, KktSystem::kRingReach);
      border_ = DeviceBuffer<double>(square * chain_);
      corner_ = DeviceBuffer<double>(square);
      border_.set_zero(stream);
      corner_.set_zero(stream);
    } else {
      open_.emplace(chain_, size, ordering, 2, batch);
    }
    signs_ = repeated(host_signs_, batch);
    border_signs_ = repeated(host_border_signs_, batch);
    regularization_.set_zero(stream);  // the assembly regularizes
    stream.synchronize();
  }

  KktArrays arrays() const {
    return {matrix_.diagonal(), matrix_.lower(), border_.data(), corner_.data()};
  }

  linalg::Ordering ordering() const { return ring_ ? ring_->ordering() : open_->ordering(); }

  void list(const int* listed, int places) {
    ring_ ? ring_->list(listed, places) : open_->list(listed, places);
  }
  void factor() {
    const Stream& stream = device_.stream();
    if (ring_) {
      ring_->enqueue_factor(matrix_, border_.data(), corner_.data(), signs_.data(),
                            border_signs_.data(), regularization_.data(), stream);
    } else {
      open_->enqueue_factor(matrix_, signs_.data(), regularization_.data(), stream);
    }
  }
  void solve(double* x, int m) {
    const Stream& stream = device_.stream();
    ring_ ? ring_->enqueue_solve(x, m, stream) : open_->enqueue_solve(x, m, stream);
  }
  void reserve(int m) {
    ring_ ? ring_->reserve_refinement(m, device_.stream()) : open_->reserve_refinement(m);
  }
  void refine(const double* rhs, double* x, int m, int steps, double tolerance) {
    const Stream& stream = device_.stream();
    ring_ ? ring_->enqueue_refine(matrix_, rhs, x, m, steps, tolerance, stream)
          : open_->enqueue_refine(matrix_, rhs, x, m, steps, tolerance, stream);
  }
  const int* failed() const { return ring_ ? ring_->failed_stages() : open_->failed_stages(); }
  std::string failure(int item) {
    const Stream& stream = device_.stream();
    const signed char* signs = host_signs_.data();
    if (!ring_) return open_->failure(item, signs, 0.0, -1, stream).what();
    return ring_->failure(item, signs, host_border_signs_.data(), 0.0, -1, stream).what();
  }

 private:
  long rows() const { return matrix_.rows(); }
  void set_zero(double* values, std::size_t count) const {
    if (count == 0) return;
    TRAJOPT_CUDA_CHECK(cudaMemsetAsync(values, 0, count * sizeof(double), device_.stream().get()));
  }
  DeviceBuffer<signed char> repeated(const std::vector<signed char>& signs, int batch) const {
    std::vector<signed char> all;
    for (int item = 0; item < batch; ++item) all.insert(all.end(), signs.begin(), signs.end());
    DeviceBuffer<signed char> buffer(all.size());
    buffer.upload(all.data(), all.size(), device_.stream());
    device_.stream().synchronize();
    return buffer;
  }

  CudaDevice device_;
  const int chain_;  // blocks, without the border
  BlockTridiagonal matrix_;
  std::optional<Factorization> open_;  // one of the two
  std::optional<BorderedFactorization> ring_;
  DeviceBuffer<double> border_, corner_;
  const std::vector<signed char> host_signs_, host_border_signs_;
  DeviceBuffer<signed char> signs_, border_signs_;
  DeviceBuffer<double> regularization_;
};

}  // namespace

std::unique_ptr<BatchExecutor> make_executor(const std::vector<BatchMember>& members,
                                             const ExecutorOptions& options) {
  return std::make_unique<FramesExecutor<CudaDevice>>(CudaDevice(), members, options);
}

}  // namespace trajopt::cuda
