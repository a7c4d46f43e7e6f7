#pragma once

#include <pybind11/pybind11.h>

namespace trajopt::bindings {

void register_cuda_linalg(pybind11::module_& m);  // with CUDA only
void register_devices(pybind11::module_& m);
void register_interior_point(pybind11::module_& m);
void register_linalg(pybind11::module_& m);
void register_model(pybind11::module_& m);
void register_paper(pybind11::module_& m);
void register_problem(pybind11::module_& m);
void register_solver(pybind11::module_& m);

}  // namespace trajopt::bindings
