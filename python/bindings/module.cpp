// The extension module `trajopt._core`: one file per core folder registers its own part.
#include <pybind11/pybind11.h>

#include "bindings.h"
#include "trajopt/base/error.h"
#include "trajopt/base/isa.h"
#include "trajopt/base/parallel.h"

namespace py = pybind11;

PYBIND11_MODULE(_core, m) {
  m.doc() = "Compiled core of trajopt.";
  m.attr("__version__") = TRAJOPT_VERSION;
  m.def(
      "isa", [] { return trajopt::isa_name(trajopt::active_isa()); },
      "Instruction set the hot code runs with: portable, avx2 or avx512.");
  m.def("hardware_threads", &trajopt::hardware_threads);
  // NOLINTNEXTLINE(performance-unnecessary-value-param): the type that pybind11 asks for
  py::register_exception_translator([](std::exception_ptr p) {
    try {
      if (p) std::rethrow_exception(p);
    } catch (const trajopt::ArgumentError& error) {
      const py::object type = py::module_::import("trajopt.errors").attr("ArgumentError");
      PyErr_SetString(type.ptr(), error.what());
    }
  });
  trajopt::bindings::register_devices(m);
  trajopt::bindings::register_linalg(m);
#ifdef TRAJOPT_WITH_CUDA
  trajopt::bindings::register_cuda_linalg(m);
#endif
  trajopt::bindings::register_model(m);
  trajopt::bindings::register_problem(m);
  trajopt::bindings::register_solver(m);
  trajopt::bindings::register_paper(m);
  trajopt::bindings::register_interior_point(m);
}
