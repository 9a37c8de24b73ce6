#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "lamina/error.h"
#include "lamina/mesh_receiver.h"
#include "meshes/mesh_format.h"
#include "meshes/mesh_sink.h"

namespace lamina {
namespace {

constexpr std::size_t kVerticesAtOnce = 1U << 14;

}  // namespace

void take_vertices(const TriangleMesh& mesh, std::size_t first, std::size_t count, VertexBatch& out) {
  out.x.resize(count), out.y.resize(count), out.z.resize(count);
  out.nx.resize(count), out.ny.resize(count), out.nz.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    const auto& p = mesh.positions[first + i];
    out.x[i] = p[0], out.y[i] = p[1], out.z[i] = p[2];
    const auto& n = mesh.normals[first + i];
    out.nx[i] = n[0], out.ny[i] = n[1], out.nz[i] = n[2];
  }
  out.attributes.resize(mesh.attributes.size());
  for (std::size_t a = 0; a < mesh.attributes.size(); ++a) {
    const auto begin = mesh.attributes[a].begin() + static_cast<std::ptrdiff_t>(first);
    out.attributes[a].assign(begin, begin + static_cast<std::ptrdiff_t>(count));
  }
}

void append_mesh(const TriangleMesh& mesh, MeshSink& sink) {
  VertexBatch batch;
  for (std::size_t first = 0; first < mesh.positions.size(); first += kVerticesAtOnce) {
    take_vertices(mesh, first, std::min(kVerticesAtOnce, mesh.positions.size() - first), batch);
    sink.append_vertices(batch);
  }
  sink.append_triangles(mesh.triangles);
}

void write_mesh(const TriangleMesh& mesh, const StreamedMeshLayout& layout, const std::string& path,
                const RunContext& run) {
  if (mesh.layout != layout.attributes || mesh.normals.size() != mesh.positions.size())
    throw Error(ExitCode::internal, path + ": the mesh is not of the layout that it is to be written in");
  const MeshSinkSettings settings{.path = path,
                                  .tmp_dir = run.tmp_dir,
                                  .attributes = layout.attributes,
                                  .double_positions = layout.double_positions,
                                  .comments = layout.comments};
  meshes::warn_of_losses(settings, run);
  MeshSink sink(settings);
  append_mesh(mesh, sink);
  sink.commit(run);
}

}  // namespace lamina
