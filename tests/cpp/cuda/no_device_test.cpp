// What the CUDA executor says where there is no GPU. The driver, if any, is told to show none.
#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

#include "trajopt/cuda/base/buffer.h"
#include "trajopt/cuda/base/device.h"
#include "trajopt/cuda/linalg/factorization.h"

namespace trajopt::cuda {
namespace {

const bool kHidden = setenv("CUDA_VISIBLE_DEVICES", "", 1) == 0;

template <class Body>
std::string device_error(const Body& body) {
  try {
    body();
  } catch (const DeviceError& error) {
    return error.what();
  }
  return "nothing was thrown";
}

bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

TEST(NoDevice, IsANormalAnswer) {
  ASSERT_TRUE(kHidden);
  EXPECT_TRUE(devices().empty());
  EXPECT_FALSE(unavailable_reason().empty());
  EXPECT_EQ(unavailable_reason(), unavailable_reason());
  EXPECT_FALSE(build_info().toolkit.empty());
  EXPECT_FALSE(build_info().architectures.empty());
}

TEST(NoDevice, IsAnErrorOnlyWhereOneIsNeeded) {
  const std::string reason = unavailable_reason();
  EXPECT_EQ(device_error([] { require_device(); }), "no CUDA device: " + reason);
  EXPECT_EQ(device_error([] { current_device(); }), "no CUDA device: " + reason);
  EXPECT_EQ(device_error([] { Factorization(3, 2); }), "no CUDA device: " + reason);
}

TEST(NoDevice, EveryCallIsChecked) {
  const std::string stream = device_error([] { Stream(); });
  EXPECT_TRUE(contains(stream, "cudaStreamCreateWithFlags")) << stream;
  EXPECT_TRUE(contains(stream, "failed on no device: ")) << stream;
  const std::string buffer = device_error([] { DeviceBuffer<double>(1000); });
  EXPECT_TRUE(contains(buffer, "cudaMalloc failed on no device: ")) << buffer;
  EXPECT_TRUE(contains(buffer, "asked for 8000 bytes")) << buffer;
  const std::string pinned = device_error([] { PinnedBuffer<int>(10); });
  EXPECT_TRUE(contains(pinned, "asked for 40 bytes")) << pinned;
  const std::string huge = device_error([] { DeviceBuffer<double>(std::size_t{1} << 62); });
  EXPECT_TRUE(contains(huge, "more than the address space holds")) << huge;
}

TEST(NoDevice, EmptyBuffersNeedNone) {
  DeviceBuffer<double> empty(0), other;
  other = std::move(empty);
  EXPECT_EQ(other.data(), nullptr);
  EXPECT_EQ(other.bytes(), 0u);
}

}  // namespace
}  // namespace trajopt::cuda
