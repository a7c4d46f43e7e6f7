#include "trajopt/cuda/base/device.h"

#include "trajopt/cuda/base/check.h"

namespace trajopt::cuda {

namespace {

// cudaGetDeviceCount, which fails rather than say 0 where there is nothing.
cudaError_t count_devices(int* count) {
  const cudaError_t status = cudaGetDeviceCount(count);
  if (status != cudaSuccess) {
    *count = 0;
    cudaGetLastError();
  }
  return status;
}

DeviceInfo describe(int device) {
  cudaDeviceProp properties;
  TRAJOPT_CUDA_CHECK(cudaGetDeviceProperties(&properties, device));
  DeviceInfo info;
  info.name = properties.name;
  info.major = properties.major;
  info.minor = properties.minor;
  info.multiprocessors = properties.multiProcessorCount;
  info.memory = properties.totalGlobalMem;
  info.shared_memory = properties.sharedMemPerBlockOptin;
  return info;
}

}  // namespace

BuildInfo build_info() { return {TRAJOPT_CUDA_TOOLKIT, TRAJOPT_CUDA_ARCHITECTURES}; }

std::vector<DeviceInfo> devices() {
  int count = 0;
  count_devices(&count);
  std::vector<DeviceInfo> all;
  all.reserve(count);
  for (int device = 0; device < count; ++device) all.push_back(describe(device));
  return all;
}

std::string unavailable_reason() {
  int count = 0;
  const cudaError_t status = count_devices(&count);
  if (count > 0) return "";
  switch (status) {
    case cudaSuccess:
    case cudaErrorNoDevice:
      return "the NVIDIA driver finds no GPU";
    case cudaErrorInsufficientDriver: {
      int driver = 0;
      if (cudaDriverGetVersion(&driver) != cudaSuccess || driver == 0) {
        cudaGetLastError();
        return "there is no NVIDIA driver on this machine";
      }
      return "the NVIDIA driver supports CUDA " + std::to_string(driver / 1000) + "." +
             std::to_string(driver % 1000 / 10) + ", older than the " + TRAJOPT_CUDA_TOOLKIT +
             " this package was built with";
    }
    default:
      return std::string("cudaGetDeviceCount failed: ") + cudaGetErrorString(status) + " (" +
             cudaGetErrorName(status) + ")";
  }
}

void require_device() {
  const std::string reason = unavailable_reason();
  if (!reason.empty()) throw DeviceError("no CUDA device: " + reason);
}

DeviceInfo current_device() {
  require_device();
  int device = 0;
  TRAJOPT_CUDA_CHECK(cudaGetDevice(&device));
  return describe(device);
}

}  // namespace trajopt::cuda
