// What this build can run on. A build without CUDA answers the same questions.
#include <pybind11/stl.h>

#include "bindings.h"
#include "trajopt/base/error.h"
#ifdef TRAJOPT_WITH_CUDA
#include "trajopt/cuda/base/device.h"
#endif

namespace trajopt::bindings {

namespace py = pybind11;

namespace {

// None without CUDA.
py::object cuda_build() {
#ifdef TRAJOPT_WITH_CUDA
  const cuda::BuildInfo build = cuda::build_info();
  py::dict d;
  d["toolkit"] = build.toolkit;
  d["architectures"] = build.architectures;
  return d;
#else
  return py::none();
#endif
}

py::list cuda_devices() {
  py::list all;
#ifdef TRAJOPT_WITH_CUDA
  for (const cuda::DeviceInfo& device : cuda::devices()) {
    py::dict d;
    d["name"] = device.name;
    d["compute_capability"] = py::make_tuple(device.major, device.minor);
    d["multiprocessors"] = device.multiprocessors;
    d["memory"] = device.memory;
    all.append(d);
  }
#endif
  return all;
}

// "" where there is a device.
std::string cuda_unavailable() {
#ifdef TRAJOPT_WITH_CUDA
  return cuda::unavailable_reason();
#else
  return "this package was built without CUDA: install it where nvcc 12.0 or newer is found "
         "(TRAJOPT_CUDA=ON says why it is not)";
#endif
}

}  // namespace

void register_devices(py::module_& m) {
  // NOLINTNEXTLINE(performance-unnecessary-value-param): the type that pybind11 asks for
  py::register_exception_translator([](std::exception_ptr p) {
    try {
      if (p) std::rethrow_exception(p);
    } catch (const DeviceError& error) {
      const py::object type = py::module_::import("trajopt.errors").attr("DeviceError");
      PyErr_SetString(type.ptr(), error.what());
    }
  });
  m.def("cuda_build", &cuda_build, "Toolkit and architectures, or None without CUDA.");
  m.def("cuda_devices", &cuda_devices, "One dict per GPU; empty without driver or GPU.");
  m.def("cuda_unavailable", &cuda_unavailable, "Why there is no GPU to use; empty where there is.");
}

}  // namespace trajopt::bindings
