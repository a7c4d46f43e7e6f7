// Arguments that the bindings of the linear algebra share, whatever device computes.
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "arrays.h"
#include "trajopt/linalg/precision.h"
#include "trajopt/linalg/schedule.h"

namespace trajopt::bindings {

using Signs = py::array_t<signed char, py::array::c_style | py::array::forcecast>;

inline linalg::Ordering parse_ordering(const std::string& name) {
  using linalg::Ordering;
  for (Ordering ordering : {Ordering::automatic, Ordering::sequential, Ordering::cyclic,
                            Ordering::chunked, Ordering::frontal}) {
    if (name == linalg::ordering_name(ordering)) return ordering;
  }
  throw ArgumentError("ordering = '" + name +
                      "', expected 'auto', 'sequential', 'cyclic', 'chunked' or 'frontal'");
}

inline linalg::Precision parse_precision(const std::string& name) {
  for (linalg::Precision precision : {linalg::Precision::float64, linalg::Precision::float32}) {
    if (name == linalg::precision_name(precision)) return precision;
  }
  throw ArgumentError("precision is '" + name + "', expected 'float64' or 'float32'");
}

// rhs as (batch, rows, m); returns m.
inline int columns(const Array& rhs, long batch, long rows) {
  require_shape(rhs, {batch, rows, -1}, "rhs");
  return static_cast<int>(rhs.shape(2));
}

inline Array copy(const Array& from) {
  Array to(std::vector<py::ssize_t>(from.shape(), from.shape() + from.ndim()));
  std::copy_n(from.data(), from.size(), to.mutable_data());
  return to;
}

}  // namespace trajopt::bindings
