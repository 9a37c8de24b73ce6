#include "clustering/steps.h"

#include <algorithm>

#include "base/vectors.h"

namespace lamina::clustering {
namespace {

constexpr std::size_t kLeastTriangles = 1 << 15;

/// Writes vertices and counts their global numbers up.
class Numberer {
 public:
  /// `room`: add() is called at most so many times.
  Numberer(std::uint64_t next, std::size_t room, FinalSlab& out) : next_(next), out_(out) {
    resize_anew(out.vertices, room);
  }

  /// The number `vertex` gets if it counts.
  std::uint32_t add(const FinalVertex& vertex, bool counts = true) {
    out_.vertices[size_] = vertex;
    const auto number = static_cast<std::uint32_t>(next_ + size_);
    size_ += counts ? 1 : 0;
    return number;
  }
  /// Of vertices nobody counted before; not before the last add().
  std::uint32_t append(const FinalVertex& vertex) {
    if (size_ == out_.vertices.size()) {
      const std::size_t room = size_ + size_ / 8 + 256;
      out_.vertices.reserve(room);  // resize() alone would double it
      out_.vertices.resize(room);
    }
    return add(vertex);
  }
  /// Returns the next free number.
  std::uint64_t close() {
    out_.vertices.resize(size_);
    if (next_ + size_ > kNone) {
      throw Error(ExitCode::budget, "clustering: slab " + std::to_string(out_.slab) +
                                        ": the mesh has more than 4294967295 vertices; use larger cells or split the "
                                        "input");
    }
    return next_ + size_;
  }
  [[nodiscard]] std::size_t size() const { return size_; }

 private:
  std::uint64_t next_;
  std::size_t size_ = 0;
  FinalSlab& out_;
};

FinalVertex at_corner(std::uint32_t corner) {
  FinalVertex vertex;
  vertex.kind = FinalVertex::Kind::corner;
  vertex.corner = vertex.other = {corner};
  return vertex;
}

void number_corners(SlabRecord& here, Numberer& numberer, std::vector<std::array<float, 3>>& patches,
                    ClusterCounts& counts) {
  const std::size_t first = numberer.size();
  for (std::uint32_t c = 0; c < here.verdicts.size(); ++c) {
    const Verdict verdict = here.verdicts[c];
    if (verdict != Verdict::split) [[likely]] {  // written whether or not it counts: half the corners do, at random
      const bool collapses = verdict == Verdict::corner;
      here.seats[c] = numberer.add(at_corner(c), collapses);  // nobody asks for that of another verdict
      continue;
    }
    for (Component& component : here.unresolved[here.seats[c]].components) {
      if (!component.collapses) continue;
      FinalVertex vertex = at_corner(c);
      vertex.kind = FinalVertex::Kind::patch;
      vertex.other = {static_cast<std::uint32_t>(patches.size())};
      patches.push_back(component.position);
      component.number = numberer.add(vertex);
    }
  }
  counts.patches += patches.size();
  counts.collapsed += numberer.size() - first - patches.size();
}

/// The number of the vertex its cluster collapsed to.
std::uint32_t collapsed_number(const SlabRecord& owner, std::uint32_t corner, std::uint16_t component) {
  switch (owner.verdicts[corner]) {
    case Verdict::corner:
      return owner.seats[corner];
    case Verdict::split:
      return owner.unresolved[owner.seats[corner]].components[component].number;
    default:
      return kNone;
  }
}

/// Whether an isovertex of a cluster of `owner` stays a vertex of its own.
bool stays(const SlabRecord& owner, std::uint32_t corner, std::uint16_t component) {
  switch (owner.verdicts[corner]) {
    case Verdict::kept:
      return true;
    case Verdict::split:
      return !owner.unresolved[owner.seats[corner]].components[component].collapses;
    default:
      return false;
  }
}

void number_isovertices(Window& window, std::int64_t slab, Numberer& numberer, ClusterCounts& counts) {
  SlabRecord& here = window.at(slab);
  SlabRecord& below = window.at(slab - 1);
  const SlabRecord& above = window.at(slab + 1);
  for (const std::uint32_t v : below.crossing) {
    VertexNote& note = below.vertices[v];
    const std::uint32_t corner = note.corner & ~SlabIndex::kNextSlab;
    if (note.number == kNone) note.number = collapsed_number(here, corner, note.component);
  }
  for (std::size_t v = 0; v < here.vertices.size(); ++v) {
    VertexNote& note = here.vertices[v];
    if (!note.used()) continue;
    const std::uint32_t corner = note.corner & ~SlabIndex::kNextSlab;
    const SlabRecord& owner = note.crossing() ? above : here;
    if (stays(owner, corner, note.component)) {
      const IsoVertex& iso = here.iso->vertices[v];
      FinalVertex vertex;
      vertex.corner = iso.low;
      vertex.other = iso.high;
      vertex.t = iso.t;
      note.number = numberer.append(vertex);
      ++counts.kept_isovertices;
    } else {  // of a crossing one the slab above knows
      note.number = note.crossing() ? kNone : collapsed_number(here, corner, note.component);
    }
  }
}

using FinalTriangle = std::array<std::uint32_t, 3>;

bool survives(const FinalTriangle& t) {
  return t[0] != t[1] && t[1] != t[2] && t[2] != t[0];
}

void emit_border(Window& window, std::int64_t slab, FinalSlab& out) {
  const SlabRecord& here = window.at(slab);
  const SlabRecord& next = window.at(slab + 1);
  for (const IsoTriangle& triangle : here.border) {
    FinalTriangle t;
    for (std::size_t k = 0; k < 3; ++k) t[k] = (triangle[k].next() ? next : here).vertices[triangle[k].index()].number;
    if (survives(t)) out.triangles.push_back(t);
  }
}

/// Writes the slab's surviving inner triangles to `to`, returns how many.
std::size_t emit_range(const SlabRecord& here, std::span<const IsoTriangle> triangles, FinalTriangle* to) {
  const VertexNote* notes = here.vertices.data();
  FinalTriangle* end = to;
  for (const IsoTriangle& triangle : triangles) {
    if ((triangle[0].bits | triangle[1].bits | triangle[2].bits) >= SlabIndex::kNextSlab) continue;
    const VertexNote &a = notes[triangle[0].bits], &b = notes[triangle[1].bits], &c = notes[triangle[2].bits];
    if (((a.corner | b.corner | c.corner) & SlabIndex::kNextSlab) != 0) continue;
    *end = {a.number, b.number, c.number};
    end += survives(*end) ? 1 : 0;
  }
  return static_cast<std::size_t>(end - to);
}

void emit_inner(const SlabRecord& here, FinalSlab& out) {
  const std::span<const IsoTriangle> triangles(here.iso->triangles);
  const std::size_t first = out.triangles.size();
  out.triangles.resize(first + triangles.size());
  const std::size_t chunks = chunk_count(triangles.size(), kLeastTriangles);
  std::vector<std::pair<std::size_t, std::size_t>> filled(chunks);  // begin and count
  for_chunks(triangles.size(), chunks, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    FinalTriangle* to = out.triangles.data() + first + begin;
    filled[chunk] = {first + begin, emit_range(here, triangles.subspan(begin, end - begin), to)};
  });
  std::size_t size = first;
  for (const auto& [begin, count] : filled) {
    const auto from = out.triangles.begin() + static_cast<std::ptrdiff_t>(begin);
    std::move(from, from + static_cast<std::ptrdiff_t>(count),
              out.triangles.begin() + static_cast<std::ptrdiff_t>(size));
    size += count;
  }
  out.triangles.resize(size);
}

}  // namespace

void number(Window& window, std::int64_t slab, std::uint64_t& next_number, FinalSlab& out, ClusterCounts& counts) {
  SlabRecord& here = window.at(slab);
  out.slab = slab;
  out.triangles.clear();
  out.patches.clear();
  auto room = static_cast<std::size_t>(std::count(here.verdicts.begin(), here.verdicts.end(), Verdict::corner));
  for (const UnresolvedCluster& cluster : here.unresolved) room += cluster.components.size();
  Numberer numberer(next_number, room + 1, out);  // the last one is written though it may not count
  number_corners(here, numberer, out.patches, counts);
  number_isovertices(window, slab, numberer, counts);
  next_number = numberer.close();
  emit_border(window, slab - 1, out);
  emit_inner(here, out);
  counts.corners += static_cast<std::uint64_t>(
      std::count_if(here.verdicts.begin(), here.verdicts.end(), [](Verdict v) { return v != Verdict::absent; }));
  counts.resolved += here.unresolved.size();
}

}  // namespace lamina::clustering
