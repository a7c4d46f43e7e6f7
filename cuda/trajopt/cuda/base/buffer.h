// Memory that frees itself: DeviceBuffer<T> on the GPU, PinnedBuffer<T> on the host where the GPU
// can copy to and from it while the processor goes on.
#pragma once

#include <cstddef>
#include <memory>
#include <type_traits>
#include <utility>

#include "trajopt/cuda/base/check.h"
#include "trajopt/cuda/base/stream.h"

namespace trajopt::cuda {

namespace detail {

void* allocate_device(std::size_t count, std::size_t element);
void* allocate_pinned(std::size_t count, std::size_t element);

// What these return is an error of earlier work; the next checked call reports it.
struct DeviceFree {
  void operator()(void* p) const noexcept { static_cast<void>(cudaFree(p)); }
};
struct PinnedFree {
  void operator()(void* p) const noexcept { static_cast<void>(cudaFreeHost(p)); }
};

}  // namespace detail

template <class T>
class DeviceBuffer {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  DeviceBuffer() = default;
  // Not initialized. Throws DeviceError with the number of bytes when they are not there.
  explicit DeviceBuffer(std::size_t size)
      : data_(static_cast<T*>(detail::allocate_device(size, sizeof(T)))), size_(size) {}
  DeviceBuffer(DeviceBuffer&& other) noexcept
      : data_(std::move(other.data_)), size_(std::exchange(other.size_, 0)) {}
  DeviceBuffer& operator=(DeviceBuffer&& other) noexcept {
    data_ = std::move(other.data_);
    size_ = std::exchange(other.size_, 0);
    return *this;
  }

  T* data() const { return data_.get(); }
  std::size_t size() const { return size_; }
  std::size_t bytes() const { return size_ * sizeof(T); }

  // Ordered in the stream. The host memory must live until the copy is done: from pageable memory
  // a copy to the device has read it when the call returns, a copy from the device has not written.
  void upload(const T* from, std::size_t count, const Stream& stream, std::size_t at = 0) {
    copy(data() + at, from, count, cudaMemcpyHostToDevice, stream);
  }
  void download(T* to, std::size_t count, const Stream& stream, std::size_t at = 0) const {
    copy(to, data() + at, count, cudaMemcpyDeviceToHost, stream);
  }
  void copy_from(const DeviceBuffer& other, std::size_t count, const Stream& stream) {
    copy(data(), other.data(), count, cudaMemcpyDeviceToDevice, stream);
  }
  // Every byte zero: for numbers, 0.
  void set_zero(const Stream& stream) { set_bytes(0, stream); }
  void set_bytes(int byte, const Stream& stream) {
    if (size_ == 0) return;
    TRAJOPT_CUDA_CHECK(cudaMemsetAsync(data(), byte, bytes(), stream.get()));
  }

 private:
  static void copy(T* to, const T* from, std::size_t count, cudaMemcpyKind kind,
                   const Stream& stream) {
    if (count == 0) return;
    TRAJOPT_CUDA_CHECK(cudaMemcpyAsync(to, from, count * sizeof(T), kind, stream.get()));
  }

  std::unique_ptr<T[], detail::DeviceFree> data_;
  std::size_t size_ = 0;
};

template <class T>
class PinnedBuffer {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  PinnedBuffer() = default;
  explicit PinnedBuffer(std::size_t size)
      : data_(static_cast<T*>(detail::allocate_pinned(size, sizeof(T)))), size_(size) {}
  PinnedBuffer(PinnedBuffer&& other) noexcept
      : data_(std::move(other.data_)), size_(std::exchange(other.size_, 0)) {}
  PinnedBuffer& operator=(PinnedBuffer&& other) noexcept {
    data_ = std::move(other.data_);
    size_ = std::exchange(other.size_, 0);
    return *this;
  }

  T* data() const { return data_.get(); }
  std::size_t size() const { return size_; }
  T& operator[](std::size_t i) const { return data_[i]; }

 private:
  std::unique_ptr<T[], detail::PinnedFree> data_;
  std::size_t size_ = 0;
};

}  // namespace trajopt::cuda
