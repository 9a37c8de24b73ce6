#include "simplify/thin_window.h"

#include <algorithm>
#include <string>
#include <utility>

#include "base/hashing.h"
#include "lamina/error.h"
#include "measure/edge_table.h"
#include "meshes/mesh_pieces.h"

namespace lamina::simplify {
namespace {

using namespace meshes;

/// Blocks for which triangles at an open vertex wait: longer than a slab takes to be followed by the next.
constexpr std::uint32_t kPatience = 8;

constexpr double kEdgeOverArea = 2.3094;  ///< the squared side of an equilateral triangle over its area

[[noreturn]] void refuse(const char* what) {
  throw Error(ExitCode::unreadable,
              std::string("simplify: the mesh is not manifold: ") + what + "; 'lamina check' tells more");
}

}  // namespace

ThinWindow::ThinWindow(MeshBlocks& mesh, double deviation)
    : mesh_(mesh),
      deviation_(deviation),
      values_(mesh.layout().size()),
      low_(values_.size()),
      high_(values_.size()),
      done_(mesh.vertices()) {}

void ThinWindow::add(std::span<const Triangle> triangles) {
  for (const Triangle& t : triangles) {
    if (std::max({t[0], t[1], t[2]}) >= mesh_.vertices())
      throw Error(ExitCode::unreadable, "simplify: a triangle names a vertex that the mesh does not have");
    if (measure::repeats_index(t)) refuse("a triangle names a vertex twice");
  }
  VertexNumbers numbers(triangles);
  std::vector<std::uint32_t> places;
  take_in(numbers.vertices(), places);
  const std::size_t first = triangles_.size();
  triangles_.reserve(first + triangles.size());
  for (const Triangle& t : triangles)
    triangles_.push_back({places[numbers.of(t[0])], places[numbers.of(t[1])], places[numbers.of(t[2])]});
  add_planes(first);
  count_triangles();
}

/// Adds those of the vertices that are not here; `places`: where each is then.
void ThinWindow::take_in(std::span<const std::uint32_t> ids, std::vector<std::uint32_t>& places) {
  std::vector<std::uint32_t> moved(vertices_.size()), fresh, fresh_places;
  places.resize(ids.size());
  std::uint32_t old = 0, size = 0;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    while (old < vertices_.size() && vertices_[old].id < ids[i]) moved[old++] = size++;
    places[i] = size;
    if (old < vertices_.size() && vertices_[old].id == ids[i]) {
      moved[old++] = size++;
      continue;
    }
    if (done_[ids[i]]) refuse("a vertex joins parts that share no edge");
    fresh.push_back(ids[i]);
    fresh_places.push_back(size++);
  }
  while (old < vertices_.size()) moved[old++] = size++;
  vertices_.resize(size);
  while (old-- > 0) {  // the last first: none is written over before it has moved
    vertices_[moved[old]] = vertices_[old];
    ++vertices_[moved[old]].age;
  }
  for (const std::uint32_t place : fresh_places) vertices_[place] = {};
  for (Values* values : {&values_, &low_, &high_}) {
    for (std::vector<float>& of : *values) {
      std::vector<float> at(vertices_.size());
      for (std::size_t v = 0; v < moved.size(); ++v) at[moved[v]] = of[v];
      of = std::move(at);
    }
  }
  for (Triangle& t : triangles_) t = {moved[t[0]], moved[t[1]], moved[t[2]]};
  read(fresh, fresh_places);
}

void ThinWindow::read(std::span<const std::uint32_t> ids, std::span<const std::uint32_t> places) {
  std::size_t next = 0;
  const auto rows = [&](std::uint64_t first, std::size_t count, TriangleMesh& out) {
    mesh_.read_vertices(first, count, out);
  };
  for_vertex_rows(ids, rows, [&](const TriangleMesh& block, std::size_t row) {
    const std::uint32_t place = places[next];
    Vertex& vertex = vertices_[place];
    vertex.id = ids[next++];
    vertex.position = block.positions[row];
    if (mesh_.has_normals()) vertex.normal = block.normals[row];
    for (std::size_t a = 0; a < values_.size(); ++a)
      values_[a][place] = low_[a][place] = high_[a][place] = block.attributes[a][row];
    const auto known = boundary_.find(vertex.id);
    if (known == boundary_.end()) return;
    vertex.number = known->second;
    boundary_.erase(known);
  });
}

/// Of triangles that have just come: about the places of their vertices, none of which has moved, only the normal
/// counts. What a triangle adds to a budget goes with the size of those around it.
void ThinWindow::add_planes(std::size_t first) {
  std::vector<float> area(vertices_.size()), corners(vertices_.size());
  std::vector<float> areas;
  areas.reserve(triangles_.size() - first);
  for (std::size_t i = first; i < triangles_.size(); ++i) {
    const Triangle& t = triangles_[i];
    const Vec3& at = vertices_[t[0]].position;
    const Vec3 n = cross(vertices_[t[1]].position - at, vertices_[t[2]].position - at);
    const double twice = norm(n);
    areas.push_back(static_cast<float>(0.5 * twice));
    for (const std::uint32_t v : t) {
      area[v] += areas.back();
      corners[v] += 1;
    }
    if (!(twice > 0)) continue;
    const Quadric plane = plane_quadric({}, (1 / twice) * n, 0.5 * twice, kNormalNoise);
    for (const std::uint32_t v : t) {
      for (std::size_t k = 0; k < plane.a.size(); ++k) vertices_[v].quadric.a[k] += plane.a[k];
    }
  }
  const auto allowed = static_cast<float>(kEdgeOverArea * deviation_ * deviation_ / 3);
  for (std::size_t i = first; i < triangles_.size(); ++i) {
    float around = 0;
    for (const std::uint32_t v : triangles_[i]) around += area[v] / corners[v];
    for (const std::uint32_t v : triangles_[i]) vertices_[v].budget += allowed * around * areas[i - first];
  }
}

void ThinWindow::count_triangles() {
  count_.assign(vertices_.size(), 0);
  for (const Triangle& t : triangles_) {
    for (const std::uint32_t v : t) ++count_[v];
  }
}

std::array<float, 3> ThinWindow::centre(std::size_t triangle) const {
  const Triangle& t = triangles_[triangle];
  const Vec3& origin = vertices_[triangles_[0][0]].position;
  return to_float(vertices_[t[0]].position + vertices_[t[1]].position + vertices_[t[2]].position - 3 * origin);
}

ThinWindow::Part ThinWindow::part(std::span<const std::uint32_t> triangles, std::vector<std::uint32_t>& numbers) const {
  Part part;
  part.triangles.assign(triangles.begin(), triangles.end());
  ThinPart& thin = part.thin;
  thin.mesh.triangles.reserve(triangles.size());
  numbers.resize(std::max(numbers.size(), vertices_.size()), kNone);
  std::vector<std::uint32_t> here;
  for (const std::uint32_t triangle : part.triangles) {
    Triangle t = triangles_[triangle];
    for (std::uint32_t& v : t) {
      if (numbers[v] == kNone) {
        numbers[v] = static_cast<std::uint32_t>(part.vertices.size());
        part.vertices.push_back(v);
        here.push_back(0);
      }
      v = numbers[v];
      ++here[v];
    }
    thin.mesh.triangles.push_back(t);
  }
  for (const std::uint32_t v : part.vertices) numbers[v] = kNone;
  const std::size_t size = part.vertices.size();
  part.split.resize(size);
  thin.locked.resize(size);
  thin.mesh.positions.resize(size);
  if (mesh_.has_normals()) thin.mesh.normals.resize(size);
  thin.quadrics.resize(size);
  thin.budgets.resize(size);
  for (std::size_t v = 0; v < size; ++v) {
    const std::uint32_t from = part.vertices[v];
    const Vertex& vertex = vertices_[from];
    part.split[v] = here[v] < count_[from] ? 1 : 0;
    thin.locked[v] = part.split[v] != 0 || vertex.number != kNone ? 1 : 0;
    thin.mesh.positions[v] = vertex.position;
    if (mesh_.has_normals()) thin.mesh.normals[v] = vertex.normal;
    thin.quadrics[v] = vertex.quadric;
    thin.budgets[v] = vertex.budget;
  }
  const auto pick = [&](const Values& all, std::vector<std::vector<float>>& picked) {
    picked.resize(all.size());
    for (std::size_t a = 0; a < all.size(); ++a) {
      picked[a].reserve(size);
      for (const std::uint32_t from : part.vertices) picked[a].push_back(all[a][from]);
    }
  };
  pick(values_, thin.mesh.attributes);
  pick(low_, thin.low);
  pick(high_, thin.high);
  return part;
}

void ThinWindow::put_back(const Part& part) {
  const ThinPart& thin = part.thin;
  for (std::size_t v = 0; v < part.vertices.size(); ++v) {
    if (thin.locked[v] != 0) continue;
    const std::uint32_t to = part.vertices[v];
    Vertex& vertex = vertices_[to];
    vertex.position = thin.mesh.positions[v];
    if (mesh_.has_normals()) vertex.normal = thin.mesh.normals[v];
    vertex.quadric = thin.quadrics[v];
    vertex.budget = thin.budgets[v];
    for (std::size_t a = 0; a < values_.size(); ++a) {
      values_[a][to] = thin.mesh.attributes[a][v];
      low_[a][to] = thin.low[a][v];
      high_[a][to] = thin.high[a][v];
    }
  }
  for (std::size_t i = 0; i < part.triangles.size(); ++i) {
    Triangle& t = triangles_[part.triangles[i]];
    t = {kNone, kNone, kNone};
    if (i >= thin.mesh.triangles.size()) continue;
    for (std::size_t k = 0; k < 3; ++k) t[k] = part.vertices[thin.mesh.triangles[i][k]];
  }
}

std::vector<std::uint32_t> ThinWindow::settle(std::span<const Part> parts) {
  std::erase_if(triangles_, [](const Triangle& t) { return t[0] == kNone; });
  count_triangles();
  std::vector<std::uint8_t> marks(vertices_.size());
  for (const Part& part : parts) {
    for (std::size_t v = 0; v < part.vertices.size(); ++v) marks[part.vertices[v]] |= part.split[v];
  }
  spread(marks);
  std::vector<std::uint32_t> border;
  for (std::uint32_t t = 0; t < triangles_.size(); ++t) {
    if (std::any_of(triangles_[t].begin(), triangles_[t].end(), [&](std::uint32_t v) { return marks[v] != 0; }))
      border.push_back(t);
  }
  return border;
}

/// To the vertices that share a triangle with a marked one.
void ThinWindow::spread(std::vector<std::uint8_t>& marks) const {
  std::vector<std::uint8_t> wider = marks;
  for (const Triangle& t : triangles_) {
    const auto any = static_cast<std::uint8_t>(marks[t[0]] | marks[t[1]] | marks[t[2]]);
    for (const std::uint32_t v : t) wider[v] |= any;
  }
  marks = std::move(wider);
}

/// Over its triangles a vertex sums up a hash of the next vertex less one of the vertex before: nothing remains where
/// they close around it.
void ThinWindow::find_open() {
  std::vector<std::uint64_t> turns(vertices_.size()), hashes(vertices_.size());
  for (std::size_t v = 0; v < hashes.size(); ++v) hashes[v] = CounterRng(v, 0).bits();
  for (const Triangle& t : triangles_) {
    const std::array<std::uint64_t, 3> of{hashes[t[0]], hashes[t[1]], hashes[t[2]]};
    for (std::size_t k = 0; k < 3; ++k) turns[t[k]] += of[(k + 1) % 3] - of[(k + 2) % 3];
  }
  for (std::size_t v = 0; v < vertices_.size(); ++v) {
    if (vertices_[v].number == kNone) vertices_[v].open = turns[v] != 0;
  }
}

/// Vertices whose triangles wait: those that may get more, and around them, so that where what was given ends has been
/// thinned out on both sides.
std::vector<std::uint8_t> ThinWindow::find_waiting() const {
  std::vector<std::uint8_t> waits(vertices_.size());
  for (std::size_t v = 0; v < vertices_.size(); ++v) {
    const Vertex& vertex = vertices_[v];
    waits[v] = vertex.number == kNone && vertex.open && vertex.age < kPatience ? 1 : 0;
  }
  spread(waits);
  return waits;
}

TriangleMesh ThinWindow::give(bool last) {
  find_open();
  const std::vector<std::uint8_t> waits = last ? std::vector<std::uint8_t>(vertices_.size()) : find_waiting();
  TriangleMesh out;
  out.layout = mesh_.layout();
  out.attributes.resize(values_.size());
  std::size_t kept = 0;
  for (const Triangle& t : triangles_) {
    if ((waits[t[0]] | waits[t[1]] | waits[t[2]]) != 0) {
      triangles_[kept++] = t;
    } else {
      number(t, out);
    }
  }
  triangles_.resize(kept);
  keep_vertices();
  return out;
}

void ThinWindow::number(const Triangle& triangle, TriangleMesh& out) {
  Triangle numbered{};
  for (std::size_t k = 0; k < 3; ++k) {
    Vertex& vertex = vertices_[triangle[k]];
    if (vertex.number == kNone) {
      vertex.number = given_++;
      out.positions.push_back(vertex.position);
      if (mesh_.has_normals()) out.normals.push_back(vertex.normal);
      for (std::size_t a = 0; a < values_.size(); ++a) out.attributes[a].push_back(values_[a][triangle[k]]);
    }
    numbered[k] = vertex.number;
  }
  out.triangles.push_back(numbered);
}

/// Those that triangles which wait name.
void ThinWindow::keep_vertices() {
  count_triangles();
  std::vector<std::uint32_t> places(vertices_.size(), kNone);
  std::uint32_t kept = 0;
  for (std::size_t v = 0; v < vertices_.size(); ++v) {
    const Vertex& vertex = vertices_[v];
    if (count_[v] > 0) {
      for (Values* values : {&values_, &low_, &high_}) {
        for (std::vector<float>& of : *values) of[kept] = of[v];
      }
      places[v] = kept;
      vertices_[kept++] = vertex;
    } else if (vertex.number != kNone && vertex.open) {
      boundary_.emplace(vertex.id, vertex.number);
    } else {
      done_[vertex.id] = true;
    }
  }
  vertices_.resize(kept);
  for (Values* values : {&values_, &low_, &high_}) {
    for (std::vector<float>& of : *values) of.resize(kept);
  }
  for (Triangle& t : triangles_) t = {places[t[0]], places[t[1]], places[t[2]]};
}

}  // namespace lamina::simplify
