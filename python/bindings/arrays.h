// NumPy arrays in and out: contiguous doubles with checked shapes.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <algorithm>
#include <string>
#include <vector>

#include "trajopt/base/error.h"

namespace trajopt::bindings {

namespace py = pybind11;
using Array = py::array_t<double, py::array::c_style | py::array::forcecast>;
using IntArray = py::array_t<int, py::array::c_style | py::array::forcecast>;

inline std::string shape_text(const std::vector<long>& shape) {
  std::string text = "(";
  for (std::size_t i = 0; i < shape.size(); ++i)
    text += (i ? ", " : "") + (shape[i] < 0 ? std::string("n") : std::to_string(shape[i]));
  return text + (shape.size() == 1 ? ",)" : ")");
}

// Throws unless `array` has the given shape; -1 stands for any length.
template <class A>
void require_shape(const A& array, const std::vector<long>& shape, const char* name) {
  bool ok = array.ndim() == static_cast<long>(shape.size());
  std::vector<long> actual(array.shape(), array.shape() + array.ndim());
  for (std::size_t i = 0; ok && i < shape.size(); ++i) ok = shape[i] < 0 || shape[i] == actual[i];
  if (!ok) {
    throw ArgumentError(std::string(name) + " has shape " + shape_text(actual) + ", expected " +
                        shape_text(shape));
  }
}

inline py::array_t<double> empty(const std::vector<py::ssize_t>& shape) {
  return py::array_t<double>(shape);
}

inline std::vector<double> to_vector(const Array& a) { return {a.data(), a.data() + a.size()}; }

inline py::array_t<double> to_array(const std::vector<double>& v,
                                    const std::vector<py::ssize_t>& shape) {
  py::array_t<double> a(shape);
  std::copy(v.begin(), v.end(), a.mutable_data());
  return a;
}

inline py::array_t<double> to_array(const std::vector<double>& v) {
  return to_array(v, {static_cast<py::ssize_t>(v.size())});
}

}  // namespace trajopt::bindings
