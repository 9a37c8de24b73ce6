// Manifold iso meshes for the clusterer's tests: marching cubes with a consistent face rule on a uniform lattice, with
// cells or loops left out, cut into slabs of any height. Independent of the program's extraction.
#pragma once
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "isosurface/iso_mesh.h"

namespace lamina::test {

inline constexpr std::int32_t kCell = 16;  ///< steps per cell

struct LatticeCase {
  std::array<int, 3> size{4, 4, 4};                       ///< corners per axis
  std::function<double(int, int, int)> distance;          ///< sign and interpolation
  std::function<float(int, int, int, int)> t;             ///< optional: t of the edge at (x, y, z, axis)
  std::function<bool(int, int, int, int)> loop_accepted;  ///< optional: loop i of the cell at (x, y, z)
  int merge = 1;                                          ///< corners per cluster and axis: 2 makes crowded clusters
};

/// The whole mesh with global indices.
struct FlatMesh {
  struct Vertex {
    std::uint32_t low, high;
    float t;
    int axis, z;
    bool near_high;
    [[nodiscard]] std::uint32_t cluster() const { return near_high ? high : low; }
  };
  std::vector<std::array<int, 3>> corners;  ///< lattice positions, ascending in z, y, x
  std::vector<Vertex> vertices;             ///< ascending in z
  std::vector<std::array<std::uint32_t, 3>> triangles;
  std::vector<int> triangle_z;  ///< ascending
};

namespace detail {

struct CubeEdge {
  int axis, low, high;  ///< corners of the cube: bit per axis
  unsigned faces;       ///< the two faces it lies in, bit 2 * axis + side
};

inline const std::array<CubeEdge, 12>& cube_edges() {
  static const std::array<CubeEdge, 12> edges = [] {
    std::array<CubeEdge, 12> out{};
    std::size_t n = 0;
    for (int axis = 0; axis < 3; ++axis) {
      for (int corner = 0; corner < 8; ++corner) {
        if ((corner >> axis & 1) != 0) continue;
        unsigned faces = 0;
        for (int other = 0; other < 3; ++other) {
          if (other != axis) faces |= 1U << (2 * other + (corner >> other & 1));
        }
        out[n++] = {axis, corner, corner | 1 << axis, faces};
      }
    }
    return out;
  }();
  return edges;
}

inline int edge_between(int a, int b) {
  for (int e = 0; e < 12; ++e) {
    const CubeEdge& edge = cube_edges()[static_cast<std::size_t>(e)];
    if ((edge.low == a && edge.high == b) || (edge.low == b && edge.high == a)) return e;
  }
  return -1;
}

/// Triangulates loop[i..j] with chords that lie in no face of the cube.
inline bool triangulate(const std::vector<int>& loop, std::size_t i, std::size_t j,
                        std::vector<std::array<int, 3>>& out) {
  if (j - i < 2) return true;
  const auto allowed = [&](std::size_t a, std::size_t b) {
    if (b - a == 1 || (a == 0 && b + 1 == loop.size())) return true;
    const auto& edges = cube_edges();
    return (edges[static_cast<std::size_t>(loop[a])].faces & edges[static_cast<std::size_t>(loop[b])].faces) == 0;
  };
  for (std::size_t k = i + 1; k < j; ++k) {
    if (!allowed(i, k) || !allowed(k, j)) continue;
    const std::size_t size = out.size();
    out.push_back({loop[i], loop[k], loop[j]});
    if (triangulate(loop, i, k, out) && triangulate(loop, k, j, out)) return true;
    out.resize(size);
  }
  return false;
}

struct CubeLoop {
  std::vector<int> edges;
  std::vector<std::array<int, 3>> triangles;
};

/// Loops of each sign case; on every face a crossing from - to + is linked to the next crossing of the face's cycle.
inline const std::array<std::vector<CubeLoop>, 256>& cube_table() {
  static const std::array<std::vector<CubeLoop>, 256> table = [] {
    std::array<std::vector<CubeLoop>, 256> out;
    for (unsigned signs = 0; signs < 256; ++signs) {
      std::array<int, 12> link;
      link.fill(-1);
      for (int axis = 0; axis < 3; ++axis) {
        for (int side = 0; side < 2; ++side) {
          const int u = 1 << (axis + 1) % 3, v = 1 << (axis + 2) % 3, base = side << axis;
          std::array<int, 4> cycle{base, base | u, base | u | v, base | v};
          if (side == 0) std::swap(cycle[1], cycle[3]);
          std::vector<std::pair<int, bool>> crossings;  // edge, from - to +
          for (std::size_t k = 0; k < 4; ++k) {
            const int a = cycle[k], b = cycle[(k + 1) % 4];
            const bool pa = (signs >> a & 1) != 0, pb = (signs >> b & 1) != 0;
            if (pa != pb) crossings.emplace_back(edge_between(a, b), pb);
          }
          for (std::size_t k = 0; k < crossings.size(); ++k) {
            if (!crossings[k].second) continue;
            link[static_cast<std::size_t>(crossings[k].first)] = crossings[(k + 1) % crossings.size()].first;
          }
        }
      }
      for (int e = 0; e < 12; ++e) {
        if (link[static_cast<std::size_t>(e)] < 0) continue;
        CubeLoop loop;
        for (int at = e; link[static_cast<std::size_t>(at)] >= 0;) {
          loop.edges.push_back(at);
          at = std::exchange(link[static_cast<std::size_t>(at)], -1);
        }
        if (!triangulate(loop.edges, 0, loop.edges.size() - 1, loop.triangles)) std::abort();
        out[signs].push_back(std::move(loop));
      }
    }
    return out;
  }();
  return table;
}

}  // namespace detail

/// Marching cubes. An isovertex whose accepted cells are two opposite ones is doubled, so every vertex is a single fan.
inline FlatMesh make_mesh(const LatticeCase& lattice) {
  const auto [nx, ny, nz] = lattice.size;
  const auto id = [nx = nx, ny = ny](int x, int y, int z) {
    return (static_cast<std::size_t>(z) * static_cast<std::size_t>(ny) + static_cast<std::size_t>(y)) *
               static_cast<std::size_t>(nx) +
           static_cast<std::size_t>(x);
  };
  const std::size_t count = id(0, 0, nz);
  std::vector<double> d(count);
  for (int z = 0; z < nz; ++z) {
    for (int y = 0; y < ny; ++y) {
      for (int x = 0; x < nx; ++x) d[id(x, y, z)] = lattice.distance(x, y, z);
    }
  }
  // Accepted quadrants of each edge: the cell's place around the edge, from its corner's bits in the other two axes.
  std::vector<std::array<std::uint8_t, 3>> quadrants(count, {0, 0, 0});
  const auto for_loops = [&](const auto& fn) {
    for (int z = 0; z + 1 < nz; ++z) {
      for (int y = 0; y + 1 < ny; ++y) {
        for (int x = 0; x + 1 < nx; ++x) {
          unsigned signs = 0;
          for (int c = 0; c < 8; ++c) {
            if (d[id(x + (c & 1), y + (c >> 1 & 1), z + (c >> 2))] > 0) signs |= 1U << c;
          }
          int i = 0;
          for (const detail::CubeLoop& loop : detail::cube_table()[signs]) {
            if (!lattice.loop_accepted || lattice.loop_accepted(x, y, z, i)) fn(x, y, z, loop);
            ++i;
          }
        }
      }
    }
  };
  const auto quadrant_of = [](const detail::CubeEdge& edge) {
    return (edge.low >> (edge.axis + 1) % 3 & 1) | (edge.low >> (edge.axis + 2) % 3 & 1) << 1;
  };
  const auto edge_corner = [&](int x, int y, int z, const detail::CubeEdge& edge) {
    return id(x + (edge.low & 1), y + (edge.low >> 1 & 1), z + (edge.low >> 2));
  };
  for_loops([&](int x, int y, int z, const detail::CubeLoop& loop) {
    for (const int e : loop.edges) {
      const detail::CubeEdge& edge = detail::cube_edges()[static_cast<std::size_t>(e)];
      quadrants[edge_corner(x, y, z, edge)][static_cast<std::size_t>(edge.axis)] |=
          static_cast<std::uint8_t>(1 << quadrant_of(edge));
    }
  });
  FlatMesh mesh;
  std::map<std::array<int, 3>, std::uint32_t> clusters;  // by z, y, x
  for (int z = 0; z < nz; ++z) {
    for (int y = 0; y < ny; ++y) {
      for (int x = 0; x < nx; ++x) {
        const int m = lattice.merge;
        clusters.try_emplace({z / m * m, y / m * m, x / m * m}, 0U);
      }
    }
  }
  for (auto& [place, index] : clusters) {
    index = static_cast<std::uint32_t>(mesh.corners.size());
    mesh.corners.push_back({place[2], place[1], place[0]});
  }
  const auto cluster_at = [&](int x, int y, int z) {
    const int m = lattice.merge;
    return clusters.at({z / m * m, y / m * m, x / m * m});
  };
  std::vector<std::array<std::array<std::uint32_t, 2>, 3>> vertex_of(count);
  for (int z = 0; z < nz; ++z) {
    for (int y = 0; y < ny; ++y) {
      for (int x = 0; x < nx; ++x) {
        for (int axis = 0; axis < 3; ++axis) {
          const std::size_t here = id(x, y, z);
          const std::uint8_t mask = quadrants[here][static_cast<std::size_t>(axis)];
          if (mask == 0) continue;
          const int hx = x + (axis == 0 ? 1 : 0), hy = y + (axis == 1 ? 1 : 0), hz = z + (axis == 2 ? 1 : 0);
          const double a = std::abs(d[here]), b = std::abs(d[id(hx, hy, hz)]);
          const float t = lattice.t ? lattice.t(x, y, z, axis) : static_cast<float>(a / (a + b));
          const FlatMesh::Vertex vertex{cluster_at(x, y, z), cluster_at(hx, hy, hz), t, axis, z, t > 0.5F};
          auto& ids = vertex_of[here][static_cast<std::size_t>(axis)];
          ids[0] = ids[1] = static_cast<std::uint32_t>(mesh.vertices.size());
          mesh.vertices.push_back(vertex);
          if (mask == 0b1001 || mask == 0b0110) {
            ids[1] = ids[0] + 1;
            mesh.vertices.push_back(vertex);
          }
        }
      }
    }
  }
  for_loops([&](int x, int y, int z, const detail::CubeLoop& loop) {
    for (const auto& triangle : loop.triangles) {
      std::array<std::uint32_t, 3> out{};
      for (std::size_t k = 0; k < 3; ++k) {
        const detail::CubeEdge& edge = detail::cube_edges()[static_cast<std::size_t>(triangle[k])];
        const auto& ids = vertex_of[edge_corner(x, y, z, edge)][static_cast<std::size_t>(edge.axis)];
        out[k] = ids[quadrant_of(edge) >= 2 ? 1 : 0];
      }
      mesh.triangles.push_back(out);
      mesh.triangle_z.push_back(z);
    }
  });
  return mesh;
}

struct CutMesh {
  std::vector<std::shared_ptr<const IsoSlab>> slabs;
  std::vector<std::vector<std::uint32_t>> corner_ids;  ///< per slab, global corner of each entry
};

/// Cuts the mesh into slabs of `height` cells, the first beginning `shift` cells below the lattice.
inline CutMesh cut(const FlatMesh& mesh, int height, int shift = 0) {
  const auto slab_of = [&](int z) { return static_cast<std::size_t>((z + shift) / height); };
  std::size_t slabs = 1;
  for (const auto& corner : mesh.corners) slabs = std::max(slabs, slab_of(corner[2]) + 1);
  std::vector<IsoSlab> out(slabs);
  CutMesh result;
  result.corner_ids.resize(slabs);
  std::vector<std::uint32_t> corner_index(mesh.corners.size()), vertex_index(mesh.vertices.size());
  std::vector<bool> named(mesh.corners.size(), false);
  for (const FlatMesh::Vertex& vertex : mesh.vertices) named[vertex.low] = named[vertex.high] = true;
  for (std::size_t c = 0; c < mesh.corners.size(); ++c) {
    if (!named[c]) continue;
    const std::size_t s = slab_of(mesh.corners[c][2]);
    corner_index[c] = static_cast<std::uint32_t>(out[s].corners.size());
    SurfaceCorner corner;
    for (std::size_t k = 0; k < 3; ++k) corner.position[k] = mesh.corners[c][k] * kCell;
    corner.cell = static_cast<float>(kCell);
    out[s].corners.push_back(corner);
    result.corner_ids[s].push_back(static_cast<std::uint32_t>(c));
  }
  const auto relative = [](std::uint32_t index, std::size_t from, std::size_t to) {
    return SlabIndex{index | (to == from ? 0U : SlabIndex::kNextSlab)};
  };
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    const FlatMesh::Vertex& vertex = mesh.vertices[v];
    const std::size_t s = slab_of(mesh.corners[vertex.low][2]);
    vertex_index[v] = static_cast<std::uint32_t>(out[s].vertices.size());
    IsoVertex iso;
    iso.low = relative(corner_index[vertex.low], s, slab_of(mesh.corners[vertex.low][2]));
    iso.high = relative(corner_index[vertex.high], s, slab_of(mesh.corners[vertex.high][2]));
    iso.t = vertex.t;
    iso.axis = static_cast<std::uint8_t>(vertex.axis);
    iso.near_high = vertex.near_high;
    out[s].vertices.push_back(iso);
  }
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const std::size_t s = slab_of(mesh.triangle_z[i]);
    IsoTriangle triangle;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t v = mesh.triangles[i][k];
      triangle[k] = relative(vertex_index[v], s, slab_of(mesh.vertices[v].z));
    }
    out[s].triangles.push_back(triangle);
  }
  for (std::size_t s = 0; s < slabs; ++s) {
    out[s].slab = static_cast<std::int64_t>(s) - 3;  // negative slab numbers occur too
    result.slabs.push_back(std::make_shared<const IsoSlab>(std::move(out[s])));
  }
  return result;
}

}  // namespace lamina::test
