// Block tridiagonal systems on a GPU: the interface of BlockFactorization, so that `trajopt.linalg`
// need not know which it has. Built with CUDA only.
#include <pybind11/stl.h>

#include <memory>
#include <optional>
#include <string>

#include "bindings.h"
#include "linalg_arrays.h"
#include "trajopt/cuda/linalg/factorization.h"

namespace trajopt::bindings {

namespace {

using cuda::Factorization;
using linalg::SymmetricBlockTridiagonal;

long rows(const Factorization& f) { return static_cast<long>(f.blocks()) * f.size(); }

void factor(Factorization& f, const SymmetricBlockTridiagonal& a, const std::optional<Signs>& signs,
            double regularization, int) {
  if (signs) require_shape(*signs, {a.batch(), a.rows()}, "signs");
  const signed char* s = signs ? signs->data() : nullptr;
  const py::gil_scoped_release release;
  f.factor(a, s, regularization);
}

Array solve(Factorization& f, const Array& rhs, int) {
  const int m = columns(rhs, f.batch(), rows(f));
  Array x = copy(rhs);
  double* data = x.mutable_data();
  const py::gil_scoped_release release;
  f.solve(data, m);
  return x;
}

py::tuple refine(Factorization& f, const SymmetricBlockTridiagonal& a, const Array& rhs,
                 const Array& x, int max_steps, double tolerance, int) {
  const int m = columns(rhs, f.batch(), rows(f));
  columns(x, f.batch(), rows(f));
  Array better = copy(x);
  const double* b = rhs.data();
  double* data = better.mutable_data();
  linalg::Refinement result;
  {
    const py::gil_scoped_release release;
    result = f.refine(a, b, data, m, max_steps, tolerance);
  }
  return py::make_tuple(better, result.steps, result.residual);
}

}  // namespace

void register_cuda_linalg(py::module_& m) {
  py::class_<Factorization>(m, "CudaBlockFactorization")
      .def(py::init([](int blocks, int size, const std::string& ordering, int chunks, int batch,
                       const std::string& precision) {
             return std::make_unique<Factorization>(blocks, size, parse_ordering(ordering), chunks,
                                                    batch, parse_precision(precision));
           }),
           py::arg("blocks"), py::arg("size"), py::arg("ordering"), py::arg("chunks"),
           py::arg("batch"), py::arg("precision") = "float64")
      .def("factor", &factor, py::arg("a"), py::arg("signs"), py::arg("regularization"),
           py::arg("threads"))
      .def("solve", &solve, py::arg("rhs"), py::arg("threads"))
      .def("refine", &refine, py::arg("a"), py::arg("rhs"), py::arg("x"), py::arg("max_steps"),
           py::arg("tolerance"), py::arg("threads"))
      .def_property_readonly("device_bytes", &Factorization::device_bytes)
      .def_property_readonly(
          "ordering", [](const Factorization& f) { return linalg::ordering_name(f.ordering()); });
}

}  // namespace trajopt::bindings
