#include "mesh.h"

#include <fmt/format.h>
#include <pybind11/numpy.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>
#include <utility>

#include "arrays.h"
#include "run.h"

namespace lamina::python {
namespace {

template <class Use>
void with_type(ScalarType type, const Use& use) {
  switch (type) {
    case ScalarType::int8:
      return use(std::int8_t{});
    case ScalarType::uint8:
      return use(std::uint8_t{});
    case ScalarType::int16:
      return use(std::int16_t{});
    case ScalarType::uint16:
      return use(std::uint16_t{});
    case ScalarType::int32:
      return use(std::int32_t{});
    case ScalarType::uint32:
      return use(std::uint32_t{});
    case ScalarType::float32:
      return use(float{});
    case ScalarType::float64:
      return use(double{});
  }
}

/// Adds the values in the column's type, integers rounded and clamped as in a file.
void append_values(TypedColumn& column, const std::vector<float>& values) {
  with_type(column.spec.type, [&](auto zero) {
    using T = decltype(zero);
    const std::size_t before = column.bytes.size() / sizeof(T);
    column.bytes.resize((before + values.size()) * sizeof(T));
    T* out = reinterpret_cast<T*>(column.bytes.data()) + before;
    for (std::size_t i = 0; i < values.size(); ++i) {
      if constexpr (std::is_floating_point_v<T>) {
        out[i] = static_cast<T>(values[i]);
      } else {
        constexpr double kLow = std::numeric_limits<T>::min(), kHigh = std::numeric_limits<T>::max();
        const double value = std::isnan(values[i]) ? 0 : static_cast<double>(values[i]);
        out[i] = static_cast<T>(std::llrint(std::clamp(value, kLow, kHigh)));
      }
    }
  });
}

std::vector<float> as_floats(const TypedColumn& column) {
  std::vector<float> values(column.bytes.size() / static_cast<std::size_t>(byte_size(column.spec.type)));
  with_type(column.spec.type, [&](auto zero) {
    using T = decltype(zero);
    const T* from = reinterpret_cast<const T*>(column.bytes.data());
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<float>(from[i]);
  });
  return values;
}

/// Whether floats hold the positions.
bool are_floats(const TriangleMesh& mesh) {
  return std::all_of(mesh.positions.begin(), mesh.positions.end(), [](const auto& p) {
    return std::all_of(p.begin(), p.end(), [](double c) { return static_cast<double>(static_cast<float>(c)) == c; });
  });
}

py::ssize_t rows(std::size_t count) {
  return static_cast<py::ssize_t>(count);
}

py::array vertices_of(const std::shared_ptr<MeshData>& mesh) {
  auto& positions = mesh->geometry.positions;
  return shared_array(mesh, reinterpret_cast<double*>(positions.data()), {rows(positions.size()), 3});
}

py::array faces_of(const std::shared_ptr<MeshData>& mesh) {
  auto& triangles = mesh->geometry.triangles;
  return shared_array(mesh, reinterpret_cast<std::uint32_t*>(triangles.data()), {rows(triangles.size()), 3});
}

py::object normals_of(const std::shared_ptr<MeshData>& mesh) {
  auto& normals = mesh->geometry.normals;
  if (normals.empty()) return py::none();
  return shared_array(mesh, reinterpret_cast<float*>(normals.data()), {rows(normals.size()), 3});
}

py::dict attributes_of(const std::shared_ptr<MeshData>& mesh) {
  py::dict all;
  for (TypedColumn& column : mesh->columns) {
    with_type(column.spec.type, [&](auto zero) {
      using T = decltype(zero);
      all[py::str(column.spec.name)] =
          shared_array(mesh, reinterpret_cast<T*>(column.bytes.data()), {rows(column.bytes.size() / sizeof(T))});
    });
  }
  return all;
}

py::object colors_of(const std::shared_ptr<MeshData>& mesh) {
  const py::dict all = attributes_of(mesh);
  py::list channels;
  for (const char* name : {"red", "green", "blue"}) {
    if (!all.contains(name)) return py::none();
    channels.append(all[name]);
  }
  if (all.contains("alpha")) channels.append(all["alpha"]);
  return py::module_::import("numpy").attr("stack")(channels, -1);
}

/// A (n, 3) array's values, converted where it is of another type.
template <class T>
std::vector<std::array<T, 3>> copied(const py::object& object) {
  const auto array = py::array_t<T, py::array::c_style | py::array::forcecast>::ensure(object);
  if (!array) throw py::error_already_set();
  if (array.ndim() != 2 || array.shape(1) != 3) throw py::value_error("an array of shape (n, 3) is wanted");
  const auto* from = reinterpret_cast<const std::array<T, 3>*>(array.data());
  return {from, from + array.shape(0)};
}

std::vector<std::array<std::uint32_t, 3>> copied_faces(const py::object& object) {
  const py::array array = py::array::ensure(object);
  if (!array || (array.dtype().kind() != 'i' && array.dtype().kind() != 'u'))
    throw py::type_error("faces must be an array of integers");
  if (array.size() > 0 && array.attr("min")().cast<std::int64_t>() < 0)
    throw py::value_error("faces must not be negative");
  return copied<std::uint32_t>(object);
}

std::shared_ptr<MeshData> mesh_of_arrays(const py::object& vertices, const py::object& faces, const py::object& normals,
                                         const py::dict& attributes) {
  auto data = std::make_shared<MeshData>();
  float_array(vertices, "vertices", 3);
  data->geometry.positions = copied<double>(vertices);
  data->geometry.triangles = copied_faces(faces);
  if (!normals.is_none()) {
    float_array(normals, "normals", 3);
    data->geometry.normals = copied<float>(normals);
  }
  for (const auto& [name, array] : attribute_arrays(attributes, data->geometry.positions.size())) {
    const ScalarType type = *scalar_type_of(array.dtype());
    const py::array packed = py::module_::import("numpy").attr("ascontiguousarray")(array);
    const auto* bytes = static_cast<const std::byte*>(packed.data());
    data->columns.push_back({{name, type}, {bytes, bytes + packed.nbytes()}});
  }
  data->require_whole();
  return data;
}

std::shared_ptr<MeshData> read_data(const std::string& path) {
  const py::gil_scoped_release unlocked;
  return std::make_shared<MeshData>(read_mesh(path));
}

void save(const Mesh& mesh, const py::object& path) {
  const std::vector<std::string> names = paths_of(path);
  if (names.size() != 1) throw py::type_error("save: a path is wanted");
  mesh.data->require_whole();
  run_job({}, py::none(), [&](const RunContext& context) {
    const WithAttributes whole(mesh.data);
    if (!mesh.data->layout) return write_mesh(whole.mesh(), names.front());
    StreamedMeshLayout layout = *mesh.data->layout;
    layout.attributes = whole.mesh().layout;
    layout.double_positions = layout.double_positions || !are_floats(whole.mesh());
    write_mesh(whole.mesh(), layout, names.front(), context);
  });
}

std::string describe_mesh_data(const Mesh& mesh) {
  return fmt::format("<lamina.Mesh: {} vertices, {} faces>", mesh.data->geometry.positions.size(),
                     mesh.data->geometry.triangles.size());
}

}  // namespace

MeshData::MeshData(TriangleMesh mesh) : geometry(std::move(mesh)) {
  for (std::size_t a = 0; a < geometry.layout.size(); ++a) {
    columns.push_back({geometry.layout[a], {}});
    append_values(columns.back(), geometry.attributes[a]);
  }
  geometry.layout.clear();
  geometry.attributes.clear();
}

void MeshData::append(const TriangleMesh& piece) {
  const auto join = [](auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
  join(geometry.positions, piece.positions);
  join(geometry.normals, piece.normals);
  join(geometry.triangles, piece.triangles);
  for (std::size_t a = 0; a < piece.attributes.size(); ++a) append_values(columns[a], piece.attributes[a]);
}

void MeshData::require_whole() const {
  const std::size_t n = geometry.positions.size();
  if (!geometry.normals.empty() && geometry.normals.size() != n)
    throw py::value_error(fmt::format("{} normals for {} vertices", geometry.normals.size(), n));
  for (std::size_t t = 0; t < geometry.triangles.size(); ++t) {
    for (const std::uint32_t v : geometry.triangles[t]) {
      if (v >= n) throw py::value_error(fmt::format("face {} names vertex {}, there are {}", t, v, n));
    }
  }
}

WithAttributes::WithAttributes(const std::shared_ptr<MeshData>& data) : data_(data) {
  const std::lock_guard lock(data_->mutex_);
  if (data_->users_++ > 0) return;
  for (const TypedColumn& column : data_->columns) {
    data_->geometry.layout.push_back(column.spec);
    data_->geometry.attributes.push_back(as_floats(column));
  }
}

WithAttributes::~WithAttributes() {
  const std::lock_guard lock(data_->mutex_);
  if (--data_->users_ > 0) return;
  data_->geometry.layout.clear();
  data_->geometry.attributes.clear();
}

void MeshData::begin(const StreamedMeshLayout& of_run) {
  layout = of_run;
  for (const AttributeSpec& spec : of_run.attributes) columns.push_back({spec, {}});
}

void MeshData::append(const MeshData& piece) {
  append(piece.geometry);
  for (std::size_t a = 0; a < columns.size(); ++a) {
    const std::vector<std::byte>& bytes = piece.columns[a].bytes;
    columns[a].bytes.insert(columns[a].bytes.end(), bytes.begin(), bytes.end());
  }
}

std::shared_ptr<MeshData> mesh_argument(const py::object& object) {
  if (py::isinstance<Mesh>(object)) {
    std::shared_ptr<MeshData> data = object.cast<const Mesh&>().data;
    data->require_whole();
    return data;
  }
  const std::vector<std::string> names = paths_of(object);
  if (names.size() != 1) throw py::type_error("a lamina.Mesh or the path of a mesh is wanted");
  return read_data(names.front());
}

py::object from_json(const std::string& text) {
  return py::module_::import("json").attr("loads")(text);
}

template <class Holder>
void add_arrays(py::class_<Holder>& type) {
  type.def_property_readonly(
          "vertices", [](const Holder& held) { return vertices_of(held.data); },
          "(n, 3) float64: positions, in the units of the points.")
      .def_property_readonly(
          "faces", [](const Holder& held) { return faces_of(held.data); },
          "(m, 3) uint32: numbers of vertices, counter-clockwise seen from outside.")
      .def_property_readonly(
          "normals", [](const Holder& held) { return normals_of(held.data); }, "(n, 3) float32, or None.")
      .def_property_readonly(
          "attributes", [](const Holder& held) { return attributes_of(held.data); },
          "name -> (n,), each in the type it came in: a dict made for every call, of arrays that are "
          "not.")
      .def_property_readonly(
          "colors", [](const Holder& held) { return colors_of(held.data); },
          "(n, 3) or (n, 4), a copy of red, green, blue and alpha in their type; None without.");
}
template void add_arrays<Mesh>(py::class_<Mesh>&);
template void add_arrays<Slab>(py::class_<Slab>&);

void add_mesh(py::module_& module) {
  py::class_<Mesh> type(module, "Mesh", R"(A triangle mesh.

Its arrays are the mesh's own memory: they are not copied, may be changed in place, and stay valid when the mesh
is gone.)");
  add_arrays<Mesh>(type);
  type.def(py::init(
               [](const py::object& vertices, const py::object& faces, const py::object& normals,
                  const py::dict& attributes) { return Mesh{mesh_of_arrays(vertices, faces, normals, attributes)}; }),
           py::arg("vertices"), py::arg("faces"), py::arg("normals") = py::none(), py::arg("attributes") = py::dict(),
           R"(A mesh of copies of these arrays.

vertices: (n, 3), float32 or float64. faces: (m, 3), integers, numbers of vertices, counter-clockwise seen from
outside. normals: (n, 3) or None. attributes: name -> (n,); colors of (n, 3) or (n, 4) become red, green, blue, alpha.
Raises TypeError or ValueError for arrays of another type or shape, or a face that names no vertex.)")
      .def_static(
          "from_file",
          [](const py::object& path) {
            const std::vector<std::string> names = paths_of(path);
            if (names.size() != 1) throw py::type_error("from_file: a path is wanted");
            return Mesh{read_data(names.front())};
          },
          py::arg("path"), "Reads .ply, .obj, .off, .stl or .glb, each also as .gz. Raises lamina.Error, exit_code 3.")
      .def("save", &save, py::arg("path"),
           R"(Writes .ply, .obj, .off, .stl or .glb; the file appears when it is complete.

A mesh that surface() made is written as the same bytes that the program writes. Raises lamina.Error: exit_code 2
for another ending, 4 when it cannot be written.)")
      .def_property_readonly(
          "stats",
          [](const Mesh& mesh) -> py::object {
            if (mesh.data->statistics.empty()) return py::none();
            return from_json(mesh.data->statistics);
          },
          "Counts, times and memory of the run that made it, as the program's --stats; None for other meshes.")
      .def("__repr__", &describe_mesh_data);
}

}  // namespace lamina::python
