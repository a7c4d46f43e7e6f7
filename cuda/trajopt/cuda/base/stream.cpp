#include "trajopt/cuda/base/stream.h"

namespace trajopt::cuda {

Stream::Stream() {
  cudaStream_t stream = nullptr;
  // Does not wait for the default stream, which other libraries of the process may be using.
  TRAJOPT_CUDA_CHECK(cudaStreamCreateWithFlags(&stream, cudaStreamNonBlocking));
  stream_.reset(stream);
}

void Stream::synchronize() const { TRAJOPT_CUDA_CHECK(cudaStreamSynchronize(get())); }

Event::Event() {
  cudaEvent_t event = nullptr;
  TRAJOPT_CUDA_CHECK(cudaEventCreate(&event));
  event_.reset(event);
}

void Event::record(const Stream& stream) const {
  TRAJOPT_CUDA_CHECK(cudaEventRecord(get(), stream.get()));
}

void Event::synchronize() const { TRAJOPT_CUDA_CHECK(cudaEventSynchronize(get())); }

void wait(const Stream& stream, const Event& event) {
  TRAJOPT_CUDA_CHECK(cudaStreamWaitEvent(stream.get(), event.get(), 0));
}

double elapsed_ms(const Event& begin, const Event& end) {
  float ms = 0.0f;
  TRAJOPT_CUDA_CHECK(cudaEventElapsedTime(&ms, begin.get(), end.get()));
  return ms;
}

void Graph::begin(const Stream& stream) {
  TRAJOPT_CUDA_CHECK(cudaStreamBeginCapture(stream.get(), cudaStreamCaptureModeThreadLocal));
}

void Graph::abandon(const Stream& stream) noexcept {
  cudaGraph_t graph = nullptr;
  static_cast<void>(cudaStreamEndCapture(stream.get(), &graph));
  if (graph) static_cast<void>(cudaGraphDestroy(graph));
  static_cast<void>(cudaGetLastError());
}

Graph Graph::end(const Stream& stream) {
  cudaGraph_t captured = nullptr;
  TRAJOPT_CUDA_CHECK(cudaStreamEndCapture(stream.get(), &captured));
  const detail::Owned<cudaGraph_t, detail::GraphDestroy> graph(captured);
  cudaGraphExec_t exec = nullptr;
  TRAJOPT_CUDA_CHECK(cudaGraphInstantiate(&exec, graph.get(), 0));
  Graph result;
  result.exec_.reset(exec);
  return result;
}

void Graph::launch(const Stream& stream) const {
  TRAJOPT_CUDA_CHECK(cudaGraphLaunch(exec_.get(), stream.get()));
}

}  // namespace trajopt::cuda
