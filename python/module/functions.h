// The functions of the module, by theme; each adds its own.
#pragma once
#include <pybind11/pybind11.h>

namespace lamina::python {

void add_surface_functions(pybind11::module_& module);
void add_stream(pybind11::module_& module);
void add_point_functions(pybind11::module_& module);
void add_mesh_functions(pybind11::module_& module);
void add_picture_functions(pybind11::module_& module);
void add_volume_functions(pybind11::module_& module);

}  // namespace lamina::python
