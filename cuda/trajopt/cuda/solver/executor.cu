// FramesExecutor with CUDA memory, launches and graphs. What the launches compute stands in
// cpp/trajopt.

// What follows `if constexpr (...) return` is unreachable, and what only the other branch uses
// unused, in one of two instantiations.
#ifdef __CUDACC__
#pragma nv_diag_suppress 128, 177
#endif

#include <string>
#include <vector>

#include "trajopt/cuda/base/buffer.h"
#include "trajopt/cuda/base/device.h"
#include "trajopt/cuda/base/launch.cuh"
#include "trajopt/cuda/linalg/factorization.h"
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
             FoldChunksWork<StepItems>, FoldRestWork, AssembleWork, NodesWork<GatherGradient>,
             NodesWork<WriteStepsRhs>, NodesWork<MeasureSteps>, NodesWork<ComposeStep>,
             NodesWork<WriteCorrectionRhs>, NodesWork<ApplyCorrection>, NodesWork<AcceptTrial>,
             NodesWork<RemoveEpsilon>, NodesWork<SplineFrames<false>>,
             NodesWork<SplineFrames<true>>, NodesWork<SplineRotations>,
             NodesWork<ReduceConstraint<false>>, NodesWork<ReduceConstraint<true>>,
             NodesWork<ReduceGradient>, AssembleSplineWork>();
  }

  std::string name() const { return "cuda"; }
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

class CudaDevice::Solver {
 public:
  Solver(const CudaDevice& device, int blocks, int size, linalg::Ordering ordering,
         const std::vector<signed char>& signs, int batch)
      : device_(device),
        factorization_(blocks, size, ordering, 2, batch),
        matrix_(blocks, size, batch),
        host_signs_(signs),
        signs_(signs.size() * batch),
        regularization_(1) {
    const Stream& stream = device_.stream();
    const std::size_t block = sizeof(double) * size * size * batch;
    TRAJOPT_CUDA_CHECK(cudaMemsetAsync(matrix_.diagonal(), 0, block * blocks, stream.get()));
    if (blocks > 1) {
      TRAJOPT_CUDA_CHECK(cudaMemsetAsync(matrix_.lower(), 0, block * (blocks - 1), stream.get()));
    }
    std::vector<signed char> all;
    for (int item = 0; item < batch; ++item) all.insert(all.end(), signs.begin(), signs.end());
    signs_.upload(all.data(), all.size(), stream);
    regularization_.set_zero(stream);  // the assembly regularizes
    stream.synchronize();
  }

  double* diagonal() const { return matrix_.diagonal(); }
  double* lower() const { return matrix_.lower(); }

  void list(const int* listed, int places) { factorization_.list(listed, places); }
  void factor() {
    factorization_.enqueue_factor(matrix_, signs_.data(), regularization_.data(), device_.stream());
  }
  void solve(double* x, int m) { factorization_.enqueue_solve(x, m, device_.stream()); }
  void reserve(int m) { factorization_.reserve_refinement(m); }
  void refine(const double* rhs, double* x, int m, int steps, double tolerance) {
    factorization_.enqueue_refine(matrix_, rhs, x, m, steps, tolerance, device_.stream());
  }
  const int* failed() const { return factorization_.failed_stages(); }
  std::string failure(int item) {
    return factorization_.failure(item, host_signs_.data(), 0.0, -1, device_.stream()).what();
  }

 private:
  CudaDevice device_;
  Factorization factorization_;
  BlockTridiagonal matrix_;
  std::vector<signed char> host_signs_;
  DeviceBuffer<signed char> signs_;
  DeviceBuffer<double> regularization_;
};

}  // namespace

std::unique_ptr<BatchExecutor> make_executor(const std::vector<BatchMember>& members,
                                             const ExecutorOptions& options) {
  for (const BatchMember& m : members) require_device_support(*m.problem, "cuda");
  return std::make_unique<FramesExecutor<CudaDevice>>(CudaDevice(), members, options);
}

}  // namespace trajopt::cuda
