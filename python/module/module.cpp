// lamina._lamina: what the Python package lamina is made of.
#include <pybind11/pybind11.h>

#include "functions.h"
#include "lamina/run.h"
#include "mesh.h"
#include "run.h"

PYBIND11_MODULE(_lamina, module) {
  using namespace lamina::python;
  translate_errors();
  module.attr("__version__") = lamina::version();
  add_mesh(module);
  add_surface_functions(module);
  add_stream(module);
  add_point_functions(module);
  add_mesh_functions(module);
  add_picture_functions(module);
  add_volume_functions(module);
}
