// lamina.render: a picture as an array.
#include <pybind11/numpy.h>

#include <memory>
#include <string>
#include <utility>

#include "arrays.h"
#include "common/console.h"
#include "common/model.h"
#include "functions.h"
#include "keywords.h"
#include "lamina/render.h"
#include "mesh.h"
#include "run.h"
#include "tables.h"

namespace lamina::python {
namespace {

/// Points of an array, drawn as such.
TriangleMesh cloud_of(const py::object& points) {
  const py::array_t<double, py::array::c_style | py::array::forcecast> array(float_array(points, "mesh", 3));
  const auto* from = reinterpret_cast<const std::array<double, 3>*>(array.data());
  TriangleMesh mesh;
  mesh.positions.assign(from, from + array.shape(0));
  return mesh;
}

py::array render_picture(const py::object& model, const py::object& progress, const py::kwargs& keywords) {
  Keywords words("render");
  words.leave_out({"frames"});
  tools::PictureOptions picture;
  tools::RunOptions run;
  tools::add_picture_options(words.app(), picture);
  tools::add_run_options(words.app(), run);
  words.parse(keywords);
  const RenderSettings& look = picture.settings;
  picture.model.as_triangles = look.flat || look.wire || look.mark_boundary;
  const std::vector<std::string> names = paths_of(model);
  std::shared_ptr<MeshData> data;
  TriangleMesh cloud;
  if (names.empty()) {
    if (py::isinstance<Mesh>(model))
      data = mesh_argument(model);
    else
      cloud = cloud_of(model);
  }
  Image image;
  run_job(run, progress, [&](const RunContext& context) {
    tools::require_together(picture);
    std::unique_ptr<tools::Model> shown;
    if (!names.empty())
      shown = tools::open_model(names.front(), picture.model, context);
    else if (data)
      shown = tools::hold_mesh(WithAttributes(data).mesh(), "mesh", picture.model.paint, context);
    else
      shown = tools::hold_mesh(std::move(cloud), "points", picture.model.paint, context);
    Renderer renderer(look, context);
    shown->frame(renderer);
    shown->draw(renderer);
    if (renderer.blank()) context.warn("nothing of it is in the picture; is the zoom's place inside the model?");
    image = renderer.finish();
  });
  const auto held = std::make_shared<std::vector<std::uint8_t>>(std::move(image.pixels));
  return shared_array(held, held->data(), {image.height, image.width, 3});
}

void write_picture(const py::object& path, const py::object& picture) {
  const auto array = py::array_t<std::uint8_t, py::array::c_style>::ensure(picture);
  const std::vector<std::string> names = paths_of(path);
  if (!array || array.ndim() != 3 || array.shape(2) != 3 || names.size() != 1)
    throw py::value_error("save_png: a path and a (height, width, 3) uint8 array are wanted");
  const Image image{
      static_cast<int>(array.shape(1)), static_cast<int>(array.shape(0)), {array.data(), array.data() + array.size()}};
  const py::gil_scoped_release unlocked;
  write_png(image, names.front());
}

}  // namespace

void add_picture_functions(py::module_& module) {
  Keywords words("render");
  words.leave_out({"frames"});
  tools::PictureOptions picture;
  tools::RunOptions run;
  tools::add_picture_options(words.app(), picture);
  tools::add_run_options(words.app(), run);
  words.list_in(module);
  module.def("render", &render_picture, py::arg("model"), py::kw_only(), py::arg("progress") = py::none(),
             (R"(Draws a picture: (height, width, 3) uint8, sRGB, from the top.

model: a Mesh, an (n, 3) float array of points, or the path of a mesh, a cloud or a .vdb. Needs no screen. Raises
lamina.Error as the program does.

)" + words.describe())
                 .c_str());
  module.def("save_png", &write_picture, py::arg("path"), py::arg("picture"),
             "Writes a picture of render() as PNG. Raises lamina.Error, exit_code 4, when it cannot be written.");
}

}  // namespace lamina::python
