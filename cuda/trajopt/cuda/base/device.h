// Which GPUs there are. Plain C++: this header needs no CUDA header, and none of its functions but
// require_device() minds that there is no driver.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace trajopt::cuda {

struct DeviceInfo {
  std::string name;
  int major = 0, minor = 0;  // compute capability
  int multiprocessors = 0;
  std::size_t memory = 0;         // [bytes]
  std::size_t shared_memory = 0;  // most a thread block may ask for [bytes]
};

struct BuildInfo {
  std::string toolkit;        // version of nvcc
  std::string architectures;  // as CMake has them: "80-real 90-virtual"
};

BuildInfo build_info();

// Empty where there is no driver or no device.
std::vector<DeviceInfo> devices();

// Why devices() is empty; "" when it is not.
std::string unavailable_reason();

// Throws DeviceError with that reason.
void require_device();

// The device that new work of this thread goes to.
DeviceInfo current_device();

}  // namespace trajopt::cuda
