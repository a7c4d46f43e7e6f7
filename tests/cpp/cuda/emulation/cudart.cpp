// A CUDA runtime without a GPU, for the host side of the CUDA executor: one device whose memory is
// the processor's, where the address sanitizer watches it.
//
// Work is done as late as the runtime's rules allow, when its stream is synchronized, so that a
// forgotten wait shows. New device memory holds NaN.
#include <cuda_runtime_api.h>

#include <cstdlib>
#include <cstring>
#include <deque>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "cuda/emulation/stream_queue.h"

namespace {

using Work = std::function<void()>;

std::size_t memory = std::size_t{4} << 30, allocated = 0;
std::set<const void*> pinned;
cudaError_t last_error = cudaSuccess;

cudaError_t result(cudaError_t status) {
  if (status != cudaSuccess) last_error = status;
  return status;
}

}  // namespace

struct CUstream_st {
  std::deque<Work> queue;
  bool capturing = false;
  std::vector<Work> captured;
};
struct CUgraph_st {
  std::vector<Work> work;
};
struct CUgraphExec_st {
  std::vector<Work> work;
};
struct CUevent_st {};

namespace trajopt::emulation {

void enqueue(cudaStream_t stream, std::function<void()> work) {
  if (stream->capturing) {
    stream->captured.push_back(std::move(work));
  } else {
    stream->queue.push_back(std::move(work));
  }
}

void set_memory(std::size_t bytes) { memory = bytes; }
std::size_t allocated_memory() { return allocated; }

}  // namespace trajopt::emulation

extern "C" {

cudaError_t cudaGetLastError() { return std::exchange(last_error, cudaSuccess); }
const char* cudaGetErrorString(cudaError_t) { return "emulated error"; }
const char* cudaGetErrorName(cudaError_t) { return "cudaErrorEmulated"; }

cudaError_t cudaGetDeviceCount(int* count) { return *count = 1, cudaSuccess; }
cudaError_t cudaGetDevice(int* device) { return *device = 0, cudaSuccess; }
cudaError_t cudaDriverGetVersion(int* version) { return *version = 13000, cudaSuccess; }
cudaError_t cudaGetDeviceProperties(cudaDeviceProp* p, int) {
  *p = cudaDeviceProp{};
  std::strcpy(p->name, "Emulated");
  p->major = 9;
  p->multiProcessorCount = 16;
  p->totalGlobalMem = memory;
  p->sharedMemPerBlockOptin = 227 << 10;
  return cudaSuccess;
}
cudaError_t cudaMemGetInfo(std::size_t* free, std::size_t* total) {
  *free = memory - allocated;
  *total = memory;
  return cudaSuccess;
}

// The size stands before the memory, so that freeing it is accounted for.
cudaError_t cudaMalloc(void** p, std::size_t bytes) {
  if (allocated + bytes > memory) return result(cudaErrorMemoryAllocation);
  char* data = static_cast<char*>(std::malloc(bytes + 64));
  std::memcpy(data, &bytes, sizeof bytes);
  std::memset(data + 64, 0xff, bytes);
  allocated += bytes;
  *p = data + 64;
  return cudaSuccess;
}
cudaError_t cudaFree(void* p) {
  if (!p) return cudaSuccess;
  std::size_t bytes = 0;
  std::memcpy(&bytes, static_cast<char*>(p) - 64, sizeof bytes);
  allocated -= bytes;
  std::free(static_cast<char*>(p) - 64);
  return cudaSuccess;
}
cudaError_t cudaMallocHost(void** p, std::size_t bytes) {
  *p = std::malloc(bytes);
  pinned.insert(*p);
  return cudaSuccess;
}
cudaError_t cudaFreeHost(void* p) {
  pinned.erase(p);
  std::free(p);
  return cudaSuccess;
}

cudaError_t cudaMemcpyAsync(void* to, const void* from, std::size_t bytes, cudaMemcpyKind kind,
                            cudaStream_t stream) {
  if (kind == cudaMemcpyHostToDevice && pinned.count(from) == 0) {
    // Pageable memory has been read when the call returns.
    if (stream->capturing) return result(cudaErrorStreamCaptureUnsupported);
    const auto copy = std::make_shared<std::vector<char>>(static_cast<const char*>(from),
                                                          static_cast<const char*>(from) + bytes);
    trajopt::emulation::enqueue(stream, [=] { std::memcpy(to, copy->data(), bytes); });
  } else {
    trajopt::emulation::enqueue(stream, [=] { std::memcpy(to, from, bytes); });
  }
  return cudaSuccess;
}
cudaError_t cudaMemsetAsync(void* p, int value, std::size_t bytes, cudaStream_t stream) {
  trajopt::emulation::enqueue(stream, [=] { std::memset(p, value, bytes); });
  return cudaSuccess;
}

cudaError_t cudaStreamCreateWithFlags(cudaStream_t* stream, unsigned) {
  *stream = new CUstream_st;
  return cudaSuccess;
}
cudaError_t cudaStreamDestroy(cudaStream_t stream) {
  delete stream;
  return cudaSuccess;
}
cudaError_t cudaStreamSynchronize(cudaStream_t stream) {
  if (stream->capturing) return result(cudaErrorStreamCaptureUnsupported);
  for (; !stream->queue.empty(); stream->queue.pop_front()) stream->queue.front()();
  return cudaSuccess;
}
cudaError_t cudaStreamBeginCapture(cudaStream_t stream, cudaStreamCaptureMode) {
  stream->capturing = true;
  stream->captured.clear();
  return cudaSuccess;
}
cudaError_t cudaStreamEndCapture(cudaStream_t stream, cudaGraph_t* graph) {
  stream->capturing = false;
  *graph = new CUgraph_st{std::move(stream->captured)};
  return cudaSuccess;
}
cudaError_t cudaGraphInstantiate(cudaGraphExec_t* exec, cudaGraph_t graph, unsigned long long) {
  *exec = new CUgraphExec_st{graph->work};
  return cudaSuccess;
}
cudaError_t cudaGraphLaunch(cudaGraphExec_t exec, cudaStream_t stream) {
  for (const Work& work : exec->work) trajopt::emulation::enqueue(stream, work);
  return cudaSuccess;
}
cudaError_t cudaGraphDestroy(cudaGraph_t graph) {
  delete graph;
  return cudaSuccess;
}
cudaError_t cudaGraphExecDestroy(cudaGraphExec_t exec) {
  delete exec;
  return cudaSuccess;
}

cudaError_t cudaEventCreate(cudaEvent_t* event) {
  *event = new CUevent_st;
  return cudaSuccess;
}
cudaError_t cudaEventDestroy(cudaEvent_t event) {
  delete event;
  return cudaSuccess;
}
cudaError_t cudaEventRecord(cudaEvent_t, cudaStream_t) { return cudaSuccess; }
// Streams of the emulation wait for nothing, so tests of more than one cannot use it.
cudaError_t cudaEventSynchronize(cudaEvent_t) { return result(cudaErrorNotSupported); }
cudaError_t cudaStreamWaitEvent(cudaStream_t, cudaEvent_t, unsigned) {
  return result(cudaErrorNotSupported);
}
cudaError_t cudaEventElapsedTime(float*, cudaEvent_t, cudaEvent_t) {
  return result(cudaErrorNotSupported);
}

}  // extern "C"
