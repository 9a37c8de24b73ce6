#include "simplify/thinning.h"

#include <algorithm>
#include <utility>

namespace lamina::simplify {
namespace {

/// Blocks for which triangles at an open vertex wait: longer than a slab takes to be followed by the next.
constexpr std::uint32_t kPatience = 8;

bool any_of(const Triangle& t, const std::vector<std::uint8_t>& marks) {
  return (marks[t[0]] | marks[t[1]] | marks[t[2]]) != 0;
}

/// To the vertices that share a triangle with a marked one.
void spread_over(std::span<const Triangle> triangles, std::vector<std::uint8_t>& marks) {
  std::vector<std::uint8_t> wider = marks;
  for (const Triangle& t : triangles) {
    const auto any = static_cast<std::uint8_t>(marks[t[0]] | marks[t[1]] | marks[t[2]]);
    for (const std::uint32_t v : t) wider[v] |= any;
  }
  marks = std::move(wider);
}

}  // namespace

ThinSeams::ThinSeams(const meshes::MeshBlocks& mesh, std::vector<float> tolerances)
    : tolerances_(std::move(tolerances)),
      layout_(mesh.layout()),
      normals_(mesh.has_normals()),
      values_(layout_.size()),
      low_(layout_.size()),
      high_(layout_.size()),
      seen_(mesh.vertices()),
      closed_(mesh.vertices()) {}

TriangleMesh ThinSeams::join(const ThinBlock& block, bool last, const RunContext& run) {
  note_vertices(block);
  TriangleMesh out;
  out.layout = layout_;
  out.attributes.resize(layout_.size());
  give_inner(block, out);
  take_in(block);
  thin(run);
  give(last, out);
  return out;
}

void ThinSeams::note_vertices(const ThinBlock& block) {
  for (std::size_t v = 0; v < block.ids.size(); ++v) {
    const std::uint32_t id = block.ids[v];
    const bool closes = block.turns[v] == 0;
    if (closes ? seen_[id] : closed_[id]) refuse_to_thin("a vertex joins parts that share no edge");
    seen_[id] = true;
    if (closes) closed_[id] = true;
  }
}

/// Triangles away from open vertices, and so from the seams.
void ThinSeams::give_inner(const ThinBlock& block, TriangleMesh& out) {
  const ThinPart& part = block.part;
  std::vector<std::uint8_t> marks = part.locked;
  spread_over(part.triangles, marks);
  numbers_.assign(block.ids.size(), kNone);
  seam_.clear();
  for (std::uint32_t i = 0; i < part.triangles.size(); ++i) {
    Triangle t = part.triangles[i];
    if (any_of(t, marks)) {
      seam_.push_back(i);
      continue;
    }
    for (std::uint32_t& v : t) {
      if (numbers_[v] == kNone) {
        numbers_[v] = given_++;
        out.positions.push_back(part.vertices[v].at);
        if (normals_) out.normals.push_back(part.carried.normals[v]);
        for (std::size_t a = 0; a < layout_.size(); ++a) out.attributes[a].push_back(part.carried.values[a][v]);
      }
      v = numbers_[v];
    }
    out.triangles.push_back(t);
  }
}

/// The others, with their vertices.
void ThinSeams::take_in(const ThinBlock& block) {
  std::vector<std::uint32_t> places(block.ids.size(), kNone);
  for (const std::uint32_t i : seam_) {
    for (const std::uint32_t v : block.part.triangles[i]) places[v] = 0;
  }
  const auto before = static_cast<std::uint32_t>(vertices_.size());
  std::vector<std::uint32_t> moved(before);
  std::vector<std::uint8_t> is_new(block.ids.size());
  std::uint32_t old = 0, size = 0;
  for (std::size_t v = 0; v < places.size(); ++v) {
    if (places[v] == kNone) continue;
    while (old < before && vertices_[old].id < block.ids[v]) moved[old++] = size++;
    places[v] = size;
    is_new[v] = old == before || vertices_[old].id != block.ids[v] ? 1 : 0;
    if (is_new[v] == 0) moved[old++] = size;
    ++size;
  }
  while (old < before) moved[old++] = size++;
  vertices_.resize(size);
  while (old-- > 0) {  // the last first: none is written over before it has moved
    vertices_[moved[old]] = vertices_[old];
    vertices_[moved[old]].news = false;
    ++vertices_[moved[old]].age;
  }
  for (Values* values : {&values_, &low_, &high_}) {
    for (std::vector<float>& of : *values) {
      std::vector<float> at(size);
      for (std::size_t v = 0; v < before; ++v) at[moved[v]] = of[v];
      of = std::move(at);
    }
  }
  for (Triangle& t : triangles_) t = {moved[t[0]], moved[t[1]], moved[t[2]]};
  for (std::uint32_t v = 0; v < places.size(); ++v) {
    if (places[v] != kNone) put(block, v, places[v], is_new[v] != 0);
  }
  for (const std::uint32_t i : seam_) {
    const Triangle& t = block.part.triangles[i];
    triangles_.push_back({places[t[0]], places[t[1]], places[t[2]]});
  }
}

/// An open vertex has been at the same place in all blocks.
void ThinSeams::put(const ThinBlock& block, std::uint32_t from, std::uint32_t to, bool is_new) {
  const ThinPart& part = block.part;
  Vertex& vertex = vertices_[to];
  if (is_new) {
    vertex = {part.vertices[from], {}, part.budgets[from], block.turns[from], block.ids[from], numbers_[from]};
    if (normals_) vertex.normal = part.carried.normals[from];
    for (std::size_t a = 0; a < layout_.size(); ++a) {
      values_[a][to] = part.carried.values[a][from];
      low_[a][to] = part.low[a][from];
      high_[a][to] = part.high[a][from];
    }
    if (const auto known = boundary_.find(vertex.id); vertex.turns != 0 && known != boundary_.end()) {
      vertex.number = known->second;
      vertex.open = true;
      boundary_.erase(known);
    }
  } else {
    vertex.stands += part.vertices[from];
    vertex.budget += part.budgets[from];
    vertex.turns += block.turns[from];
  }
  if (vertex.number != kNone) return;
  vertex.open = vertex.turns != 0;
  vertex.news = !vertex.open && block.turns[from] != 0;
  if (vertex.news) closed_[vertex.id] = true;
}

/// Around vertices that the last block has closed.
void ThinSeams::thin(const RunContext& run) {
  std::vector<std::uint8_t> marks(vertices_.size());
  for (std::size_t v = 0; v < marks.size(); ++v) marks[v] = vertices_[v].news ? 1 : 0;
  spread_over(triangles_, marks);
  std::vector<std::uint32_t> triangles;
  for (std::uint32_t t = 0; t < triangles_.size(); ++t) {
    if (any_of(triangles_[t], marks)) triangles.push_back(t);
  }
  if (triangles.empty()) return;
  take_out(triangles);
  const Matching::Result result = matching_.thin(part_, tolerances_, run);
  contractions_ += (triangles.size() - result.triangles) / 2;
  deviation_ = std::max(deviation_, result.deviation);
  put_back(triangles);
}

void ThinSeams::take_out(std::span<const std::uint32_t> triangles) {
  count_triangles();
  std::vector<std::uint32_t> numbers(vertices_.size(), kNone), here;
  taken_.clear();
  part_.triangles.clear();
  for (const std::uint32_t triangle : triangles) {
    Triangle t = triangles_[triangle];
    for (std::uint32_t& v : t) {
      if (numbers[v] == kNone) {
        numbers[v] = static_cast<std::uint32_t>(taken_.size());
        taken_.push_back(v);
        here.push_back(0);
      }
      v = numbers[v];
      ++here[v];
    }
    part_.triangles.push_back(t);
  }
  const std::size_t size = taken_.size();
  part_.vertices.resize(size);
  part_.budgets.resize(size);
  part_.locked.resize(size);
  part_.carried.normals.resize(normals_ ? size : 0);
  for (std::size_t v = 0; v < size; ++v) {
    const Vertex& vertex = vertices_[taken_[v]];
    part_.vertices[v] = vertex.stands;
    part_.budgets[v] = vertex.budget;
    part_.locked[v] = here[v] < count_[taken_[v]] || vertex.number != kNone || vertex.open ? 1 : 0;
    if (normals_) part_.carried.normals[v] = vertex.normal;
  }
  const auto pick = [&](const Values& all, Values& picked) {
    picked.resize(all.size());
    for (std::size_t a = 0; a < all.size(); ++a) {
      picked[a].clear();
      for (const std::uint32_t from : taken_) picked[a].push_back(all[a][from]);
    }
  };
  pick(values_, part_.carried.values);
  pick(low_, part_.low);
  pick(high_, part_.high);
}

void ThinSeams::put_back(std::span<const std::uint32_t> triangles) {
  for (std::size_t v = 0; v < taken_.size(); ++v) {
    if (part_.locked[v] != 0) continue;
    Vertex& vertex = vertices_[taken_[v]];
    vertex.stands = part_.vertices[v];
    vertex.budget = part_.budgets[v];
    if (normals_) vertex.normal = part_.carried.normals[v];
    for (std::size_t a = 0; a < layout_.size(); ++a) {
      values_[a][taken_[v]] = part_.carried.values[a][v];
      low_[a][taken_[v]] = part_.low[a][v];
      high_[a][taken_[v]] = part_.high[a][v];
    }
  }
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    Triangle& t = triangles_[triangles[i]];
    t = {kNone, kNone, kNone};
    if (i >= part_.triangles.size()) continue;
    for (std::size_t k = 0; k < 3; ++k) t[k] = taken_[part_.triangles[i][k]];
  }
  std::erase_if(triangles_, [](const Triangle& t) { return t[0] == kNone; });
}

/// Triangles wait at vertices that may get more, and around them, so that where what was given ends has been thinned
/// out on both sides.
void ThinSeams::give(bool last, TriangleMesh& out) {
  std::vector<std::uint8_t> waits(vertices_.size());
  for (std::size_t v = 0; v < waits.size() && !last; ++v) {
    const Vertex& vertex = vertices_[v];
    waits[v] = vertex.number == kNone && vertex.open && vertex.age < kPatience ? 1 : 0;
  }
  spread_over(triangles_, waits);
  std::size_t kept = 0;
  for (Triangle t : triangles_) {
    if (any_of(t, waits)) {
      triangles_[kept++] = t;
      continue;
    }
    for (std::uint32_t& v : t) {
      Vertex& vertex = vertices_[v];
      if (vertex.number == kNone) {
        vertex.number = given_++;
        out.positions.push_back(vertex.stands.at);
        if (normals_) out.normals.push_back(vertex.normal);
        for (std::size_t a = 0; a < layout_.size(); ++a) out.attributes[a].push_back(values_[a][v]);
      }
      v = vertex.number;
    }
    out.triangles.push_back(t);
  }
  triangles_.resize(kept);
  keep_vertices();
}

void ThinSeams::count_triangles() {
  count_.assign(vertices_.size(), 0);
  for (const Triangle& t : triangles_) {
    for (const std::uint32_t v : t) ++count_[v];
  }
}

/// Those that triangles which wait name.
void ThinSeams::keep_vertices() {
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
    }
  }
  vertices_.resize(kept);
  for (Values* values : {&values_, &low_, &high_}) {
    for (std::vector<float>& of : *values) of.resize(kept);
  }
  for (Triangle& t : triangles_) t = {places[t[0]], places[t[1]], places[t[2]]};
}

}  // namespace lamina::simplify
