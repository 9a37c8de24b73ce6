// Meshes in Python: the library's vectors behind NumPy's arrays.
#pragma once
#include <pybind11/pybind11.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "lamina/mesh.h"
#include "lamina/mesh_receiver.h"
#include "lamina/run.h"

namespace lamina::python {

namespace py = pybind11;

/// Values of an attribute in its own type.
struct TypedColumn {
  AttributeSpec spec;
  std::vector<std::byte> bytes;
};

/// What a Mesh and the arrays that come out of it share.
class MeshData {
 public:
  MeshData() = default;
  /// Takes the mesh; its attributes become columns of their types.
  explicit MeshData(TriangleMesh mesh);

  /// Positions, normals and triangles; no attributes.
  TriangleMesh geometry;
  std::vector<TypedColumn> columns;
  std::optional<StreamedMeshLayout> layout;  ///< of the run it came from
  std::string statistics;                    ///< of that run, JSON
  std::uint64_t first_vertex = 0;            ///< of a piece: number of its first vertex in the whole mesh

  /// Before the first piece of a streamed mesh.
  void begin(const StreamedMeshLayout& of_run);
  void append(const TriangleMesh& piece);
  void append(const MeshData& piece);
  /// Every triangle's vertices are there, attributes and normals as many as vertices: else ValueError.
  void require_whole() const;

 private:
  friend class WithAttributes;
  std::mutex mutex_;
  int users_ = 0;  ///< of the attributes as floats
};

/// The mesh with its attributes as the library has them, floats, for as long as this lives.
class WithAttributes {
 public:
  explicit WithAttributes(const std::shared_ptr<MeshData>& data);
  ~WithAttributes();
  WithAttributes(const WithAttributes&) = delete;
  WithAttributes& operator=(const WithAttributes&) = delete;
  [[nodiscard]] const TriangleMesh& mesh() const { return data_->geometry; }

 private:
  std::shared_ptr<MeshData> data_;
};

/// Collects a streamed mesh.
class MeshCollector final : public MeshReceiver {
 public:
  void begin(const StreamedMeshLayout& layout) override { data_->begin(layout); }
  void take(TriangleMesh piece) override { data_->append(piece); }
  [[nodiscard]] const std::shared_ptr<MeshData>& data() const { return data_; }

 private:
  std::shared_ptr<MeshData> data_ = std::make_shared<MeshData>();
};

/// The class Mesh of Python.
struct Mesh {
  std::shared_ptr<MeshData> data;
};

/// The class Slab of Python: a finished part of a mesh that is being made.
struct Slab {
  std::shared_ptr<MeshData> data;
};

/// A Mesh, or the mesh in the file that a path names. Called with the interpreter's lock, which is released while a
/// file is read.
std::shared_ptr<MeshData> mesh_argument(const py::object& object);

/// vertices, faces, normals, attributes and colors of what has `data`.
template <class Holder>
void add_arrays(py::class_<Holder>& type);

/// JSON as Python's objects.
py::object from_json(const std::string& text);

void add_mesh(py::module_& module);

}  // namespace lamina::python
