// Streams, events and graphs that destroy themselves.
#pragma once

#include <memory>
#include <type_traits>

#include "trajopt/cuda/base/check.h"

namespace trajopt::cuda {

namespace detail {

// Errors of destruction are those of earlier work; the next checked call reports them.
struct StreamDestroy {
  void operator()(cudaStream_t s) const noexcept { static_cast<void>(cudaStreamDestroy(s)); }
};
struct EventDestroy {
  void operator()(cudaEvent_t e) const noexcept { static_cast<void>(cudaEventDestroy(e)); }
};
struct GraphDestroy {
  void operator()(cudaGraph_t g) const noexcept { static_cast<void>(cudaGraphDestroy(g)); }
};
struct GraphExecDestroy {
  void operator()(cudaGraphExec_t g) const noexcept { static_cast<void>(cudaGraphExecDestroy(g)); }
};

template <class Handle, class Destroy>
using Owned = std::unique_ptr<std::remove_pointer_t<Handle>, Destroy>;

}  // namespace detail

// A queue of work on the current device.
class Stream {
 public:
  Stream();

  cudaStream_t get() const { return stream_.get(); }
  void synchronize() const;

 private:
  detail::Owned<cudaStream_t, detail::StreamDestroy> stream_;
};

// A point in a stream, with a time.
class Event {
 public:
  Event();

  cudaEvent_t get() const { return event_.get(); }
  void record(const Stream& stream) const;
  void synchronize() const;

 private:
  detail::Owned<cudaEvent_t, detail::EventDestroy> event_;
};

// Makes later work of `stream` wait for the event.
void wait(const Stream& stream, const Event& event);

// Milliseconds between two events that have passed.
double elapsed_ms(const Event& begin, const Event& end);

// Work recorded once and launched many times: one call to the driver instead of one per kernel.
class Graph {
 public:
  Graph() = default;

  // Runs `enqueue`, whose work in `stream` is recorded instead of executed. It may launch kernels
  // and copy or set device and pinned memory, but neither allocate nor wait.
  template <class Enqueue>
  static Graph capture(const Stream& stream, const Enqueue& enqueue) {
    begin(stream);
    try {
      enqueue();
    } catch (...) {
      abandon(stream);
      throw;
    }
    return end(stream);
  }

  void launch(const Stream& stream) const;
  explicit operator bool() const { return static_cast<bool>(exec_); }

 private:
  static void begin(const Stream& stream);
  static void abandon(const Stream& stream) noexcept;
  static Graph end(const Stream& stream);

  detail::Owned<cudaGraphExec_t, detail::GraphExecDestroy> exec_;
};

}  // namespace trajopt::cuda
