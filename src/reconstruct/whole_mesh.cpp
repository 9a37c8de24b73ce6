#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <utility>

#include "base/scalar_type.h"
#include "lamina/error.h"
#include "lamina/mesh_receiver.h"
#include "meshes/mesh_sink.h"
#include "meshes/streamed_ply.h"
#include "reconstruct/mesh_output.h"

namespace lamina {
namespace {

class MeshInFiles final : public WholeMesh {
 public:
  explicit MeshInFiles(const MeshSinkSettings& settings) : sink_(settings) {}
  void write(const MeshSlab& slab) override {
    sink_.append_vertices(slab.vertices);
    sink_.append_triangles(slab.triangles);
  }
  MeshSink* files() override { return &sink_; }
  void commit(const RunContext& run) override { sink_.commit(run); }
  [[nodiscard]] std::uint64_t vertices() const override { return sink_.vertices(); }
  [[nodiscard]] std::uint64_t triangles() const override { return sink_.triangles(); }

 private:
  MeshSink sink_;
};

/// What a file of the type gives back.
std::vector<float> as_stored(ScalarType type, const std::vector<float>& values) {
  if (type == ScalarType::float32 || type == ScalarType::float64) return values;
  std::vector<float> stored(values.size());
  with_scalar_type(type, [&](auto zero) {
    for (std::size_t i = 0; i < values.size(); ++i)
      stored[i] = static_cast<float>(to_scalar<decltype(zero)>(values[i]));
  });
  return stored;
}

class HandedMesh final : public WholeMesh {
 public:
  HandedMesh(const MeshSinkSettings& settings, MeshReceiver& receiver)
      : attributes_(settings.attributes), wide_(settings.double_positions), receiver_(receiver) {
    receiver_.begin({attributes_, wide_, settings.comments});
  }

  void write(const MeshSlab& slab) override {
    const VertexBatch& from = slab.vertices;
    require_writable(from, attributes_, wide_, vertices_);
    if (from.size() > std::numeric_limits<std::uint32_t>::max() - vertices_)
      throw Error(ExitCode::budget, "the mesh has more vertices than 32-bit indices can name; cut the cloud");
    if (from.size() == 0 && slab.triangles.empty()) return;
    TriangleMesh piece;
    const auto stored = [this](double c) { return wide_ ? c : static_cast<double>(static_cast<float>(c)); };
    piece.positions.reserve(from.size());
    piece.normals.reserve(from.size());
    for (std::size_t v = 0; v < from.size(); ++v) {
      piece.positions.push_back({stored(from.x[v]), stored(from.y[v]), stored(from.z[v])});
      piece.normals.push_back({from.nx[v], from.ny[v], from.nz[v]});
    }
    piece.layout = attributes_;
    for (std::size_t a = 0; a < attributes_.size(); ++a)
      piece.attributes.push_back(as_stored(attributes_[a].type, from.attributes[a]));
    piece.triangles = slab.triangles;
    vertices_ += from.size();
    triangles_ += slab.triangles.size();
    receiver_.take(std::move(piece));
  }
  void commit(const RunContext&) override {}
  [[nodiscard]] std::uint64_t vertices() const override { return vertices_; }
  [[nodiscard]] std::uint64_t triangles() const override { return triangles_; }

 private:
  AttributeLayout attributes_;
  bool wide_;
  MeshReceiver& receiver_;
  std::uint64_t vertices_ = 0, triangles_ = 0;
};

}  // namespace

std::unique_ptr<WholeMesh> open_whole_mesh(const MeshSinkSettings& settings, MeshReceiver* receiver) {
  if (receiver != nullptr) return std::make_unique<HandedMesh>(settings, *receiver);
  return std::make_unique<MeshInFiles>(settings);
}

}  // namespace lamina
