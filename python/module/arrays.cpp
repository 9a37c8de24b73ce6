#include "arrays.h"

#include <fmt/format.h>

#include <array>

namespace lamina::python {
namespace {

constexpr std::array kChannels{"red", "green", "blue", "alpha"};

std::string shape_text(const py::array& array) {
  return py::str(array.attr("shape"));
}

std::string type_text(const py::array& array) {
  return py::str(py::object(array.dtype()));
}

bool is_native(const py::dtype& type) {
  return type.byteorder() == '=' || type.byteorder() == '|' || type.byteorder() == '<';
}

py::array as_array(const py::handle& object, const std::string& name) {
  py::array array = py::array::ensure(object);
  if (!array) {
    PyErr_Clear();
    throw py::type_error(fmt::format("{} must be an array", name));
  }
  return array;
}

void require_length(const py::array& array, const std::string& name, std::uint64_t count) {
  if (static_cast<std::uint64_t>(array.shape(0)) == count) return;
  throw py::value_error(
      fmt::format("{} has {} rows, points has {}; give one for each point", name, array.shape(0), count));
}

bool is_path(const py::handle& object) {
  return py::isinstance<py::str>(object) || py::hasattr(object, "__fspath__");
}

std::string path_text(const py::handle& object) {
  return py::module_::import("os").attr("fsdecode")(object).cast<std::string>();
}

bool is_colours(const std::string& name) {
  return name == "colors" || name == "colours";
}

}  // namespace

std::optional<ScalarType> scalar_type_of(const py::dtype& type) {
  if (!is_native(type)) return std::nullopt;
  const char kind = type.kind();
  const py::ssize_t bytes = type.itemsize();
  if (kind == 'b') return ScalarType::uint8;
  if (kind == 'f' && bytes == 4) return ScalarType::float32;
  if (kind == 'f' && bytes == 8) return ScalarType::float64;
  if (kind == 'i' && bytes == 1) return ScalarType::int8;
  if (kind == 'i' && bytes == 2) return ScalarType::int16;
  if (kind == 'i' && bytes == 4) return ScalarType::int32;
  if (kind == 'u' && bytes == 1) return ScalarType::uint8;
  if (kind == 'u' && bytes == 2) return ScalarType::uint16;
  if (kind == 'u' && bytes == 4) return ScalarType::uint32;
  return std::nullopt;
}

py::dtype dtype_of(ScalarType type) {
  switch (type) {
    case ScalarType::int8:
      return py::dtype::of<std::int8_t>();
    case ScalarType::uint8:
      return py::dtype::of<std::uint8_t>();
    case ScalarType::int16:
      return py::dtype::of<std::int16_t>();
    case ScalarType::uint16:
      return py::dtype::of<std::uint16_t>();
    case ScalarType::int32:
      return py::dtype::of<std::int32_t>();
    case ScalarType::uint32:
      return py::dtype::of<std::uint32_t>();
    case ScalarType::float32:
      return py::dtype::of<float>();
    case ScalarType::float64:
      break;
  }
  return py::dtype::of<double>();
}

py::array float_array(const py::handle& object, const std::string& name, py::ssize_t columns) {
  py::array array = as_array(object, name);
  const std::optional<ScalarType> type = scalar_type_of(array.dtype());
  if (type != ScalarType::float32 && type != ScalarType::float64) {
    throw py::type_error(
        fmt::format("{} has dtype {}, must be float32 or float64 of this machine's byte order: {}.astype"
                    "(numpy.float64) converts it",
                    name, type_text(array), name));
  }
  const bool fits = columns == 0 ? array.ndim() == 1 : array.ndim() == 2 && array.shape(1) == columns;
  if (!fits) {
    const std::string wanted = columns == 0 ? "(n,)" : fmt::format("(n, {})", columns);
    throw py::value_error(fmt::format("{} has shape {}, must have {}", name, shape_text(array), wanted));
  }
  return array;
}

std::vector<std::pair<std::string, py::array>> attribute_arrays(const py::dict& attributes, std::uint64_t count) {
  std::vector<std::pair<std::string, py::array>> arrays;
  for (const auto& [key, value] : attributes) {
    if (!py::isinstance<py::str>(key)) throw py::type_error("the names of attributes must be strings");
    const auto name = key.cast<std::string>();
    const std::string shown = fmt::format("attributes['{}']", name);
    const py::array array = as_array(value, shown);
    if (!scalar_type_of(array.dtype())) {
      throw py::type_error(
          fmt::format("{} has dtype {}; there are integers of 1, 2 and 4 bytes, float32 and float64, of "
                      "this machine's byte order: .astype(numpy.float64) holds whole numbers up to 2**53",
                      shown, type_text(array)));
    }
    const bool colours = is_colours(name) && array.ndim() == 2 && (array.shape(1) == 3 || array.shape(1) == 4);
    if (!colours && array.ndim() != 1) {
      throw py::value_error(fmt::format("{} has shape {}, must have (n,){}; give each column a name of its own", shown,
                                        shape_text(array), is_colours(name) ? ", (n, 3) or (n, 4)" : ""));
    }
    require_length(array, shown, count);
    if (!colours) {
      arrays.emplace_back(name, array);
      continue;
    }
    const py::object channels = array.attr("T");
    for (py::ssize_t c = 0; c < array.shape(1); ++c)
      arrays.emplace_back(kChannels.at(static_cast<std::size_t>(c)), py::array(channels[py::int_(c)]));
  }
  return arrays;
}

std::vector<std::string> paths_of(const py::object& object) {
  if (is_path(object)) return {path_text(object)};
  std::vector<std::string> names;
  if (!py::isinstance<py::list>(object) && !py::isinstance<py::tuple>(object)) return names;
  for (const py::handle item : object) {
    if (!is_path(item)) {
      if (names.empty()) return names;
      throw py::type_error("points: paths and others are mixed");
    }
    names.push_back(path_text(item));
  }
  return names;
}

PointArguments::PointArguments(const py::object& points, const py::object& normals, const py::object& radius,
                               const py::dict& attributes)
    : files_(paths_of(points)) {
  if (!files_.empty()) {
    if (!normals.is_none() || !radius.is_none() || !attributes.empty())
      throw py::value_error("normals, radius and attributes go with arrays; files have their own");
    return;
  }
  const py::array positions = float_array(points, "points", 3);
  count_ = static_cast<std::uint64_t>(positions.shape(0));
  for (const auto& [name, column] : {std::pair{"x", 0}, std::pair{"y", 1}, std::pair{"z", 2}})
    add(name, positions, column);
  if (!normals.is_none()) {
    const py::array array = float_array(normals, "normals", 3);
    require_length(array, "normals", count_);
    for (const auto& [name, column] : {std::pair{"nx", 0}, std::pair{"ny", 1}, std::pair{"nz", 2}})
      add(name, array, column);
  }
  if (py::isinstance<py::float_>(radius) || py::isinstance<py::int_>(radius)) {
    radius_ = radius.cast<double>();
    columns_.push_back({"radius", ScalarType::float64, nullptr, 0});
  } else if (!radius.is_none()) {
    const py::array array = float_array(radius, "radius", 0);
    require_length(array, "radius", count_);
    add("radius", array, 0);
  }
  for (const auto& [name, array] : attribute_arrays(attributes, count_)) add(name, array, 0);
}

void PointArguments::add(const std::string& name, const py::array& array, py::ssize_t column) {
  const auto* data = static_cast<const std::byte*>(array.data());
  if (array.ndim() == 2) data += column * array.strides(1);
  columns_.push_back({name, *scalar_type_of(array.dtype()), data, array.strides(0)});
  kept_.push_back(array);
}

std::unique_ptr<PointSource> PointArguments::view() const {
  std::vector<ArrayColumn> columns = columns_;
  for (ArrayColumn& column : columns)
    if (column.data == nullptr) column.data = &radius_;
  return view_points(kName, count_, std::move(columns));
}

std::unique_ptr<PointSource> PointArguments::open(const PointSettings& settings) const {
  return are_arrays() ? open_points(view(), settings) : open_points(files_, settings);
}

}  // namespace lamina::python
