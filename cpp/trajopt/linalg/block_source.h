// A block as an operation in scalar type T reads it: the factors' own numbers, or a block of the
// matrix, whose doubles are rounded on reading.
#pragma once

#include "trajopt/base/hd.h"

namespace trajopt::linalg::inline TRAJOPT_ISA {

template <class T>
class BlockSource {
 public:
  BlockSource() = default;
  // NOLINTNEXTLINE(google-explicit-constructor)
  TRAJOPT_HD BlockSource(const T* own) : own_(own) {}
  // NOLINTNEXTLINE(google-explicit-constructor)
  TRAJOPT_HD BlockSource(const double* matrix) : matrix_(matrix) {}

  TRAJOPT_HD explicit operator bool() const { return own_ || matrix_; }
  TRAJOPT_HD T operator[](long at) const {
    return matrix_ ? static_cast<T>(matrix_[at]) : own_[at];
  }

 private:
  const T* own_ = nullptr;
  const double* matrix_ = nullptr;
};

// There is nothing to round.
template <>
class BlockSource<double> {
 public:
  BlockSource() = default;
  // NOLINTNEXTLINE(google-explicit-constructor)
  TRAJOPT_HD BlockSource(const double* data) : data_(data) {}

  TRAJOPT_HD explicit operator bool() const { return data_; }
  TRAJOPT_HD double operator[](long at) const { return data_[at]; }

 private:
  const double* data_ = nullptr;
};

}  // namespace trajopt::linalg::inline TRAJOPT_ISA
