// NumPy's arrays as columns of points, where they lie, and vectors as NumPy's arrays, without a copy either way.
#pragma once
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "lamina/attributes.h"
#include "lamina/memory_points.h"
#include "lamina/points.h"

namespace lamina::python {

namespace py = pybind11;

/// The library's type for the array's; nothing for one that it does not have. Booleans are bytes.
std::optional<ScalarType> scalar_type_of(const py::dtype& type);
py::dtype dtype_of(ScalarType type);

/// `object` as an array of `columns` columns (0: of one dimension), of any layout. Throws TypeError for another type
/// than float32 or float64, ValueError for another shape; `name` is the argument's.
py::array float_array(const py::handle& object, const std::string& name, py::ssize_t columns);
/// One array of any of the library's types for each attribute. `colors` of shape (n, 3) or (n, 4) is red, green, blue
/// and alpha. Throws likewise, also for another length than `count`.
std::vector<std::pair<std::string, py::array>> attribute_arrays(const py::dict& attributes, std::uint64_t count);

/// Points of a Python call: names of files, or arrays.
class PointArguments {
 public:
  /// points: (n, 3), or a path or several; normals: (n, 3) or None; radius: (n,), a number or None; attributes: of
  /// (n,).
  PointArguments(const py::object& points, const py::object& normals, const py::object& radius,
                 const py::dict& attributes);

  /// Names of files; none for arrays.
  [[nodiscard]] const std::vector<std::string>& files() const { return files_; }
  [[nodiscard]] bool are_arrays() const { return files_.empty(); }
  /// Of arrays.
  [[nodiscard]] std::uint64_t count() const { return count_; }
  /// A source of the arrays or files. Needs no lock of the interpreter; the arguments must outlive it.
  [[nodiscard]] std::unique_ptr<PointSource> open(const PointSettings& settings) const;
  /// What stands for a file in messages.
  static constexpr const char* kName = "points";
  /// A source of the arrays alone, nothing selected.
  [[nodiscard]] std::unique_ptr<PointSource> view() const;

 private:
  void add(const std::string& name, const py::array& array, py::ssize_t column);

  std::vector<std::string> files_;
  std::uint64_t count_ = 0;
  double radius_ = 0;
  std::vector<py::array> kept_;
  std::vector<ArrayColumn> columns_;
};

/// An array over memory that `owner` keeps, which lives as long as the array.
template <class T>
py::array shared_array(const std::shared_ptr<const void>& owner, T* data, const std::vector<py::ssize_t>& shape) {
  const py::capsule base(new std::shared_ptr<const void>(owner),
                         [](void* held) { delete static_cast<std::shared_ptr<const void>*>(held); });
  return py::array_t<T>(shape, data, base);
}

/// An array that the vector becomes, without a copy.
template <class T>
py::array owning_array(std::vector<T> values) {
  const auto held = std::make_shared<std::vector<T>>(std::move(values));
  return shared_array(held, held->data(), {static_cast<py::ssize_t>(held->size())});
}
template <class T>
py::array owning_array(std::vector<std::array<T, 3>> values) {
  const auto held = std::make_shared<std::vector<std::array<T, 3>>>(std::move(values));
  return shared_array(held, held->empty() ? nullptr : held->front().data(),
                      {static_cast<py::ssize_t>(held->size()), 3});
}

/// Names of one file or several; empty for anything else.
std::vector<std::string> paths_of(const py::object& object);

}  // namespace lamina::python
