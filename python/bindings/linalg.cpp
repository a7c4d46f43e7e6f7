// Block tridiagonal systems on arrays (batch, blocks, ...): `trajopt.linalg` checks the arguments
// and folds leading axes.
#include <pybind11/stl.h>

#include <algorithm>
#include <optional>
#include <string>

#include "bindings.h"
#include "linalg_arrays.h"
#include "trajopt/linalg/factorization.h"

namespace trajopt::bindings {

namespace {

using linalg::Factorization;
using linalg::SymmetricBlockTridiagonal;

SymmetricBlockTridiagonal make_matrix(const Array& diagonal, const Array& lower) {
  require_shape(diagonal, {-1, -1, -1, -1}, "diagonal");
  const long batch = diagonal.shape(0), blocks = diagonal.shape(1), size = diagonal.shape(2);
  require_shape(diagonal, {batch, blocks, size, size}, "diagonal");
  require_shape(lower, {batch, blocks - 1, size, size}, "lower");
  SymmetricBlockTridiagonal a(static_cast<int>(blocks), static_cast<int>(size),
                              static_cast<int>(batch));
  std::copy_n(diagonal.data(), diagonal.size(), a.diagonal(0));
  std::copy_n(lower.data(), lower.size(), a.lower(0));
  return a;
}

Array matmul(const SymmetricBlockTridiagonal& a, const Array& x, int threads) {
  const int m = columns(x, a.batch(), a.rows());
  Array y(std::vector<py::ssize_t>(x.shape(), x.shape() + x.ndim()));
  const double* from = x.data();
  double* to = y.mutable_data();
  const py::gil_scoped_release release;
  a.matmul(from, to, m, threads);
  return y;
}

void factor(Factorization& f, const SymmetricBlockTridiagonal& a, const std::optional<Signs>& signs,
            double regularization, int threads) {
  if (signs) require_shape(*signs, {a.batch(), a.rows()}, "signs");
  const signed char* s = signs ? signs->data() : nullptr;
  const py::gil_scoped_release release;
  f.factor(a, s, regularization, threads);
}

Array solve(const Factorization& f, const Array& rhs, int threads) {
  const int m = columns(rhs, f.batch(), static_cast<long>(f.blocks()) * f.size());
  Array x = copy(rhs);
  double* data = x.mutable_data();
  const py::gil_scoped_release release;
  f.solve(data, m, threads);
  return x;
}

py::tuple refine(Factorization& f, const SymmetricBlockTridiagonal& a, const Array& rhs,
                 const Array& x, int max_steps, double tolerance, int threads) {
  const int m = columns(rhs, f.batch(), static_cast<long>(f.blocks()) * f.size());
  columns(x, f.batch(), static_cast<long>(f.blocks()) * f.size());
  Array better = copy(x);
  const double* b = rhs.data();
  double* data = better.mutable_data();
  linalg::Refinement result;
  {
    const py::gil_scoped_release release;
    result = f.refine(a, b, data, m, max_steps, tolerance, threads);
  }
  return py::make_tuple(better, result.steps, result.residual);
}

}  // namespace

void register_linalg(py::module_& m) {
  // NOLINTNEXTLINE(performance-unnecessary-value-param): the type that pybind11 asks for
  py::register_exception_translator([](std::exception_ptr p) {
    try {
      if (p) std::rethrow_exception(p);
    } catch (const FactorizationError& error) {
      const py::object type = py::module_::import("trajopt.errors").attr("FactorizationError");
      PyErr_SetObject(type.ptr(), type(error.what(), error.block, error.pivot).ptr());
    }
  });
  py::class_<SymmetricBlockTridiagonal>(m, "BlockTridiagonal")
      .def(py::init(&make_matrix), py::arg("diagonal"), py::arg("lower"))
      .def("matmul", &matmul, py::arg("x"), py::arg("threads"));
  py::class_<Factorization>(m, "BlockFactorization")
      .def(py::init([](int blocks, int size, const std::string& ordering, int chunks, int batch,
                       const std::string& precision) {
             return Factorization(blocks, size, parse_ordering(ordering), chunks, batch,
                                  Isa::avx512, parse_precision(precision));
           }),
           py::arg("blocks"), py::arg("size"), py::arg("ordering"), py::arg("chunks"),
           py::arg("batch"), py::arg("precision") = "float64")
      .def("factor", &factor, py::arg("a"), py::arg("signs"), py::arg("regularization"),
           py::arg("threads"))
      .def("solve", &solve, py::arg("rhs"), py::arg("threads"))
      .def("refine", &refine, py::arg("a"), py::arg("rhs"), py::arg("x"), py::arg("max_steps"),
           py::arg("tolerance"), py::arg("threads"))
      .def_property_readonly(
          "ordering", [](const Factorization& f) { return linalg::ordering_name(f.ordering()); });
}

}  // namespace trajopt::bindings
