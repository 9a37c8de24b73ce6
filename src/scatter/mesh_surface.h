// Normals and colours anywhere on a mesh; mesh_surface.cpp makes it a Surface to scatter on, too.
#pragma once
#include <array>
#include <optional>
#include <vector>

#include "lamina/mesh.h"
#include "meshes/area_sampler.h"
#include "meshes/colours.h"

namespace lamina::scatter_detail {

class MeshAttributes {
 public:
  /// The mesh must outlive it. Normals the file lacks are made: area-weighted means of the faces around a vertex.
  explicit MeshAttributes(const TriangleMesh& mesh);
  /// Unit; the triangle's own where the vertices' normals cancel.
  [[nodiscard]] std::array<double, 3> normal(const meshes::SurfacePoint& at) const;
  /// 0-255 whatever type the file has; zero without colours.
  [[nodiscard]] std::array<float, 3> colour(const meshes::SurfacePoint& at) const;
  [[nodiscard]] bool has_colour() const { return colours_.has_value(); }

 private:
  const TriangleMesh& mesh_;
  std::vector<std::array<float, 3>> made_normals_;
  const std::vector<std::array<float, 3>>& normals_;
  std::optional<meshes::ColourColumns> colours_;
};

}  // namespace lamina::scatter_detail
