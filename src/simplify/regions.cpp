#include "simplify/regions.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <numeric>
#include <span>
#include <utility>

#include "lamina/error.h"
#include "measure/edge_table.h"
#include "meshes/mesh_blocks.h"
#include "simplify/stars.h"

namespace lamina::simplify {
namespace {

/// Arrays one after the other.
class ArrayReader {
 public:
  ArrayReader(const SpillFile& file, std::uint64_t offset) : file_(file), offset_(offset) {}
  template <class T>
  void read(std::vector<T>& out, std::size_t count) {
    out.resize(count);
    const auto bytes = std::as_writable_bytes(std::span(out));
    if (!bytes.empty()) file_.read(offset_, bytes);
    offset_ += bytes.size();
  }

 private:
  const SpillFile& file_;
  std::uint64_t offset_;
};

void require_running(const RunContext& run) {
  if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
}

/// Vertices of triangles that belong to other regions than the vertices: neither may move them.
class Visitors {
 public:
  void add(std::uint32_t id) {
    ids_.push_back(id);
    if (ids_.size() >= most_) forget_repeated();
  }
  void forget_repeated() {
    std::sort(ids_.begin(), ids_.end());
    ids_.erase(std::unique(ids_.begin(), ids_.end()), ids_.end());
    most_ = std::max(most_, 2 * ids_.size());
  }
  /// Locks those, and what belongs to other regions. After forget_repeated().
  void lock(std::uint32_t region, const BoxTree& tree, RegionMesh& part) const {
    part.locked.resize(part.ids.size());
    auto from = ids_.begin();
    for (std::size_t v = 0; v < part.ids.size(); ++v) {
      from = std::lower_bound(from, ids_.end(), part.ids[v]);
      const bool visits = from != ids_.end() && *from == part.ids[v];
      part.locked[v] = visits || tree.at(part.mesh.positions[v]) != region ? 1 : 0;
    }
  }

 private:
  std::vector<std::uint32_t> ids_;  ///< ascending
  std::size_t most_ = 1U << 20;
};

class MeshRegions final : public Regions {
 public:
  MeshRegions(meshes::MeshBlocks& mesh, BoxTree tree, const std::string& tmp_dir, const RunContext& run)
      : mesh_(mesh), tree_(std::move(tree)), triangles_(tree_.boxes(), tmp_dir) {
    sort_triangles(run);
  }

  [[nodiscard]] std::uint32_t count() const override { return tree_.boxes(); }

  [[nodiscard]] RegionMesh load(std::uint32_t region) override {
    RegionMesh part;
    part.mesh.triangles = triangles_.read(region);
    meshes::VertexNumbers numbers(part.mesh.triangles);
    for (Triangle& t : part.mesh.triangles) {
      for (std::uint32_t& v : t) v = numbers.of(v);
    }
    part.ids = numbers.vertices();
    part.mesh.layout = mesh_.layout();
    part.mesh.attributes.resize(part.mesh.layout.size());
    part.mesh.positions.reserve(part.ids.size());
    if (mesh_.has_normals()) part.mesh.normals.reserve(part.ids.size());
    for (auto& values : part.mesh.attributes) values.reserve(part.ids.size());
    const auto read = [&](std::uint64_t first, std::size_t n, TriangleMesh& rows) {
      mesh_.read_vertices(first, n, rows);
    };
    meshes::for_vertex_rows(part.ids, read, [&](const TriangleMesh& rows, std::size_t row) {
      part.mesh.positions.push_back(rows.positions[row]);
      if (mesh_.has_normals()) part.mesh.normals.push_back(rows.normals[row]);
      for (std::size_t a = 0; a < rows.attributes.size(); ++a)
        part.mesh.attributes[a].push_back(rows.attributes[a][row]);
    });
    visitors_.lock(region, tree_, part);
    return part;
  }

 private:
  void sort_triangles(const RunContext& run) {
    meshes::VertexHomes homes(mesh_, [this](const meshes::Vec3& at) { return tree_.at(at); });
    std::uint64_t seen = 0;
    meshes::for_triangles(mesh_, [&](const Triangle& t) {
      if (++seen % (1U << 20) == 0) require_running(run);
      if (const std::uint32_t last = std::max({t[0], t[1], t[2]}); last >= mesh_.vertices()) {
        throw Error(ExitCode::unreadable, fmt::format("simplify: triangle {} names vertex {}, the mesh has {}",
                                                      seen - 1, last, mesh_.vertices()));
      }
      if (measure::repeats_index(t)) {
        throw Error(ExitCode::unreadable, fmt::format("simplify: the mesh is not manifold: triangle {} names vertex {} "
                                                      "twice; 'lamina check' tells more",
                                                      seen - 1, t[0] == t[1] ? t[0] : t[2]));
      }
      const Triangle at{homes.of(t[0]), homes.of(t[1]), homes.of(t[2])};
      const std::uint32_t region = meshes::bin_of_triangle(at);
      for (std::size_t k = 0; k < 3; ++k) {
        if (at[k] != region) visitors_.add(t[k]);
      }
      triangles_.add(region, t);
    });
    triangles_.finish();
    visitors_.forget_repeated();
  }

  meshes::MeshBlocks& mesh_;
  BoxTree tree_;
  meshes::TriangleBins triangles_;  ///< by region
  Visitors visitors_;
};

/// Vertices of one part taken over into another, those that are named for the first time.
class Extract {
 public:
  explicit Extract(const RegionMesh& from) : from_(from), number_(from.ids.size(), kNone), given_(from.ids.size()) {}

  RegionMesh take(std::span<const std::uint32_t> triangles) {
    RegionMesh part;
    part.mesh.layout = from_.mesh.layout;
    part.mesh.attributes.resize(from_.mesh.attributes.size());
    std::vector<std::uint32_t> vertices;
    for (const std::uint32_t triangle : triangles) {
      Triangle t = from_.mesh.triangles[triangle];
      for (std::uint32_t& v : t) {
        if (number_[v] == kNone) {
          number_[v] = static_cast<std::uint32_t>(vertices.size());
          vertices.push_back(v);
        }
        v = number_[v];
      }
      part.mesh.triangles.push_back(t);
      if (!from_.errors.empty()) part.errors.push_back(from_.errors[triangle]);
    }
    for (const std::uint32_t v : vertices) {
      number_[v] = kNone;
      part.ids.push_back(from_.ids[v]);
      if (!from_.tried.empty()) part.tried.push_back(from_.tried[v]);
      part.mesh.positions.push_back(from_.mesh.positions[v]);
      if (!from_.mesh.normals.empty()) part.mesh.normals.push_back(from_.mesh.normals[v]);
      for (std::size_t a = 0; a < part.mesh.attributes.size(); ++a)
        part.mesh.attributes[a].push_back(from_.mesh.attributes[a][v]);
      // A vertex that may move has all its triangles in one region, which gets all of its quadrics.
      part.quadrics.push_back(given_[v] ? Quadric{} : from_.quadrics[v]);
      given_[v] = true;
    }
    return part;
  }

 private:
  const RegionMesh& from_;
  std::vector<std::uint32_t> number_;
  std::vector<bool> given_;  ///< quadrics of vertices, to the first part that has them
};

class PartRegions final : public Regions {
 public:
  PartRegions(const RegionFile& from, const std::vector<RegionFile::Place>& parts, BoxTree tree,
              std::unique_ptr<RegionFile> to, const RunContext& run)
      : tree_(std::move(tree)), file_(std::move(to)), regions_(tree_.boxes()) {
    for (const RegionFile::Place& place : parts) {
      require_running(run);
      share_out(from.read(place));
    }
    file_->flush();
    visitors_.forget_repeated();
  }

  [[nodiscard]] std::uint32_t count() const override { return tree_.boxes(); }

  [[nodiscard]] RegionMesh load(std::uint32_t region) override {
    RegionMesh part;
    for (const RegionFile::Place& place : regions_[region]) join(part, file_->read(place));
    put_in_order(part);
    visitors_.lock(region, tree_, part);
    return part;
  }

 private:
  void share_out(const RegionMesh& part) {
    std::vector<std::uint32_t> home(part.ids.size());
    for (std::size_t v = 0; v < home.size(); ++v) home[v] = tree_.at(part.mesh.positions[v]);
    std::vector<std::vector<std::uint32_t>> triangles(tree_.boxes());
    for (std::uint32_t i = 0; i < part.mesh.triangles.size(); ++i) {
      const Triangle& t = part.mesh.triangles[i];
      const Triangle at{home[t[0]], home[t[1]], home[t[2]]};
      const std::uint32_t region = meshes::bin_of_triangle(at);
      for (std::size_t k = 0; k < 3; ++k) {
        if (at[k] != region) visitors_.add(part.ids[t[k]]);
      }
      triangles[region].push_back(i);
    }
    Extract extract(part);
    for (std::size_t region = 0; region < triangles.size(); ++region) {
      if (!triangles[region].empty()) regions_[region].push_back(file_->append(extract.take(triangles[region])));
    }
  }

  static void join(RegionMesh& all, const RegionMesh& part) {
    const auto first = static_cast<std::uint32_t>(all.ids.size());
    const auto add = [](auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
    add(all.ids, part.ids);
    add(all.quadrics, part.quadrics);
    add(all.errors, part.errors);
    add(all.tried, part.tried);
    add(all.mesh.positions, part.mesh.positions);
    add(all.mesh.normals, part.mesh.normals);
    all.mesh.layout = part.mesh.layout;
    all.mesh.attributes.resize(part.mesh.attributes.size());
    for (std::size_t a = 0; a < part.mesh.attributes.size(); ++a) add(all.mesh.attributes[a], part.mesh.attributes[a]);
    for (const Triangle& t : part.mesh.triangles)
      all.mesh.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
  }

  /// By their ids; of copies the first stays.
  static void put_in_order(RegionMesh& part) {
    std::vector<std::uint32_t> order(part.ids.size()), number(part.ids.size());
    std::iota(order.begin(), order.end(), 0U);
    std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
      return part.ids[a] != part.ids[b] ? part.ids[a] < part.ids[b] : a < b;
    });
    RegionMesh sorted;
    sorted.mesh.layout = part.mesh.layout;
    sorted.mesh.attributes.resize(part.mesh.attributes.size());
    for (const std::uint32_t v : order) {
      const bool copy = !sorted.ids.empty() && sorted.ids.back() == part.ids[v];
      if (copy) {
        sorted.quadrics.back() += part.quadrics[v];
      } else {
        sorted.ids.push_back(part.ids[v]);
        if (!part.tried.empty()) sorted.tried.push_back(part.tried[v]);
        sorted.quadrics.push_back(part.quadrics[v]);
        sorted.mesh.positions.push_back(part.mesh.positions[v]);
        if (!part.mesh.normals.empty()) sorted.mesh.normals.push_back(part.mesh.normals[v]);
        for (std::size_t a = 0; a < sorted.mesh.attributes.size(); ++a)
          sorted.mesh.attributes[a].push_back(part.mesh.attributes[a][v]);
      }
      number[v] = static_cast<std::uint32_t>(sorted.ids.size() - 1);
    }
    sorted.mesh.triangles = std::move(part.mesh.triangles);
    for (Triangle& t : sorted.mesh.triangles) {
      for (std::uint32_t& v : t) v = number[v];
    }
    sorted.errors = std::move(part.errors);
    part = std::move(sorted);
  }

  BoxTree tree_;
  std::unique_ptr<RegionFile> file_;
  std::vector<std::vector<RegionFile::Place>> regions_;
  Visitors visitors_;
};

}  // namespace

RegionFile::RegionFile(const std::string& tmp_dir, const TriangleMesh& layout, bool bound)
    : file_(tmp_dir), attributes_(layout.layout), normals_(!layout.normals.empty()), bound_(bound) {}

RegionFile::Place RegionFile::append(const RegionMesh& part) {
  const Place place{file_.size(), part.mesh.positions.size(), part.mesh.triangles.size()};
  const auto write = [this](const auto& array) { file_.append(std::as_bytes(std::span(array))); };
  write(part.mesh.positions);
  write(part.mesh.normals);
  for (const std::vector<float>& values : part.mesh.attributes) write(values);
  write(part.ids);
  write(part.quadrics);
  write(part.mesh.triangles);
  write(part.errors);
  write(part.tried);
  return place;
}

RegionMesh RegionFile::read(const Place& place) const {
  RegionMesh part;
  ArrayReader from(file_, place.offset);
  from.read(part.mesh.positions, place.vertices);
  if (normals_) from.read(part.mesh.normals, place.vertices);
  part.mesh.layout = attributes_;
  part.mesh.attributes.resize(attributes_.size());
  for (std::vector<float>& values : part.mesh.attributes) from.read(values, place.vertices);
  from.read(part.ids, place.vertices);
  from.read(part.quadrics, place.vertices);
  from.read(part.mesh.triangles, place.triangles);
  if (bound_) {
    from.read(part.errors, place.triangles);
    from.read(part.tried, place.vertices);
  }
  return part;
}

std::unique_ptr<Regions> regions_of_mesh(meshes::MeshBlocks& mesh, BoxTree tree, const std::string& tmp_dir,
                                         const RunContext& run) {
  return std::make_unique<MeshRegions>(mesh, std::move(tree), tmp_dir, run);
}

std::unique_ptr<Regions> regions_of_parts(const RegionFile& from, const std::vector<RegionFile::Place>& parts,
                                          BoxTree tree, std::unique_ptr<RegionFile> to, const RunContext& run) {
  return std::make_unique<PartRegions>(from, parts, std::move(tree), std::move(to), run);
}

}  // namespace lamina::simplify
