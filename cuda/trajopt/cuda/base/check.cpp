#include "trajopt/cuda/base/check.h"

#include <string>

namespace trajopt::cuda {

namespace {

// "device 0 (NVIDIA H200)". Called when something has already failed, so its own calls may fail.
std::string device_text() {
  int device = -1;
  cudaDeviceProp properties;
  if (cudaGetDevice(&device) != cudaSuccess) return "no device";
  std::string text = "device " + std::to_string(device);
  if (cudaGetDeviceProperties(&properties, device) == cudaSuccess) {
    text += " (" + std::string(properties.name) + ")";
  }
  return text;
}

std::string message(cudaError_t status, const char* call) {
  return std::string(call) + " failed on " + device_text() + ": " + cudaGetErrorString(status) +
         " (" + cudaGetErrorName(status) + ")";
}

}  // namespace

void check(cudaError_t status, const char* call) {
  if (status == cudaSuccess) return;
  cudaGetLastError();  // an error that was reported must not come up again in a later check
  throw DeviceError(message(status, call));
}

void check_launch(const char* kernel) {
  const cudaError_t status = cudaGetLastError();
  if (status == cudaSuccess) return;
  throw DeviceError(message(status, (std::string("launch of ") + kernel).c_str()));
}

void check_allocation(cudaError_t status, const char* call, std::size_t bytes) {
  if (status == cudaSuccess) return;
  cudaGetLastError();
  std::size_t free = 0, total = 0;
  std::string text = message(status, call) + ", asked for " + std::to_string(bytes) + " bytes";
  if (cudaMemGetInfo(&free, &total) == cudaSuccess) {
    text += ", " + std::to_string(free) + " of " + std::to_string(total) + " are free";
  }
  cudaGetLastError();
  throw DeviceMemoryError(text);
}

}  // namespace trajopt::cuda
