// The exceptions of the core. Bindings map each to the Python class of the same name.
#pragma once

#include <new>
#include <stdexcept>
#include <string>
#include <utility>

namespace trajopt {

// An argument has a value the function cannot work with: name, value, expectation.
struct ArgumentError : std::invalid_argument {
  using std::invalid_argument::invalid_argument;
};

// A device is missing, out of memory, or one of its calls failed: call, device, reason.
struct DeviceError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

// Its memory does not suffice: fewer problems at once may fit.
struct DeviceMemoryError : DeviceError {
  using DeviceError::DeviceError;
};

// A factorization met a pivot that is zero, not a number, or of the wrong sign.
struct FactorizationError : std::runtime_error {
  FactorizationError(const std::string& what, long block_, int pivot_)
      : std::runtime_error(what), block(block_), pivot(pivot_) {}
  long block;
  int pivot;
};

// More memory was asked for than there is.
class MemoryError : public std::bad_alloc {
 public:
  explicit MemoryError(std::string what) : what_(std::move(what)) {}
  const char* what() const noexcept override { return what_.c_str(); }

 private:
  std::string what_;
};

}  // namespace trajopt
