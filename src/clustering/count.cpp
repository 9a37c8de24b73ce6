#include "clustering/steps.h"

#include "base/vectors.h"

namespace lamina::clustering {
namespace {

constexpr std::uint32_t kNext = SlabIndex::kNextSlab;
constexpr std::size_t kLeastCounted = 1 << 14;
constexpr double kPositive = 4294967296.0;  // makes positions positive, so that truncation rounds down

/// Two corners of one cell differ by at most one lattice step per axis, so their slots differ on a lattice of one
/// level; equal slots elsewhere only send a cluster to the exact test.
std::uint8_t slot_of(const SurfaceCorner& corner) {
  const double scale = corner.cell > 0 ? 1.0 / static_cast<double>(corner.cell) : 1.0;
  unsigned slot = 0;
  for (const std::int32_t p : corner.position) {
    const auto step = static_cast<std::uint64_t>(static_cast<std::int64_t>(p * scale + kPositive));
    slot = (slot << 2) | static_cast<unsigned>(step & 3);
  }
  return static_cast<std::uint8_t>(slot);
}

/// The tables a triangle's indices refer to: this slab's [0] and the next one's [1].
struct Tables {
  std::array<VertexNote*, 2> vertices;
  std::array<CornerNote*, 2> corners;
  std::array<Ref, 2> tag;
};

/// The bit of CornerNote::edges for members in directions 2 * axis + side.
constexpr std::array<std::uint8_t, 64> make_pair_bits() {
  std::array<std::uint8_t, 64> bits{};
  std::uint8_t bit = 0;
  for (std::size_t a = 0; a < 6; ++a) {
    for (std::size_t b = a + 1; b < 6; ++b) bits[8 * a + b] = bits[8 * b + a] = bit++;
  }
  return bits;
}
constexpr std::array<std::uint8_t, 64> kPairBits = make_pair_bits();

/// Counts one triangle. `kBorder`: its indices may lie in the next slab.
template <ClusterMode mode, bool kBorder>
inline void count_triangle(const Tables& tables, const IsoTriangle& triangle) {
  std::array<VertexNote*, 3> vertex;
  std::array<std::uint32_t, 3> corner;
  std::array<Ref, 3> ref;
  for (std::size_t k = 0; k < 3; ++k) {
    const std::uint32_t bits = triangle[k].bits;
    const std::uint32_t next = kBorder ? bits >> 31 : 0;
    const std::uint32_t index = kBorder ? bits & ~kNext : bits;
    vertex[k] = tables.vertices[next] + index;
    corner[k] = vertex[k]->corner | (kBorder ? bits & kNext : 0);
    ref[k] = index | tables.tag[next];
  }
  if constexpr (mode == ClusterMode::none) {
    for (VertexNote* v : vertex) v->marks = VertexNote::kUsed;
    return;
  }
  const bool e0 = corner[0] == corner[1], e1 = corner[1] == corner[2], e2 = corner[2] == corner[0];
  // Without branches, here and below: which corners triangles share is as good as random.
  const bool three = !(e0 | e1 | e2);
  const auto marks = static_cast<std::uint8_t>(VertexNote::kUsed | (three ? VertexNote::kThree : 0));
  std::array<CornerNote*, 3> note;
  for (std::size_t k = 0; k < 3; ++k) {
    vertex[k]->marks |= marks;
    note[k] = tables.corners[kBorder ? corner[k] >> 31 : 0] + (kBorder ? corner[k] & ~kNext : corner[k]);
  }
  if constexpr (mode == ClusterMode::free) {
    for (CornerNote* n : note) n->ring_triangles = static_cast<std::uint16_t>(n->ring_triangles | three);
    return;
  }
  const std::array<bool, 3> inner{e0, e1, e2};
  for (std::size_t k = 0; k < 3; ++k) {
    const std::size_t after = (k + 1) % 3, before = (k + 2) % 3;
    vertex[k]->balance ^= ref[after] ^ ref[before];
    note[k]->ring |= static_cast<std::uint64_t>(three) << note[after]->slot;
    note[k]->ring_triangles = static_cast<std::uint16_t>(note[k]->ring_triangles + three);
    const std::uint8_t bit = kPairBits[8 * vertex[k]->direction + vertex[after]->direction];
    note[k]->edges = static_cast<std::uint16_t>(note[k]->edges | inner[k] << bit);
  }
  note[0]->inner_triangles += static_cast<std::uint8_t>(e0 & e1);
}

/// A chunk's own part of the tables: triangles inside it are counted by the chunk's thread without asking others.
struct Share {
  std::uint32_t first_vertex = 0, vertices = kNone;
  std::uint32_t first_corner = 0, corners = kNone;

  [[nodiscard]] bool owns_vertex(std::uint32_t v) const { return v - first_vertex < vertices; }
  [[nodiscard]] bool owns_corner(std::uint32_t c) const { return c - first_corner < corners; }
};

struct ChunkResult {
  std::vector<IsoTriangle> border;    ///< in order
  std::vector<IsoTriangle> deferred;  ///< touch another chunk's share
};

template <ClusterMode mode>
void count_chunk(const SlabRecord& record, const Tables& tables, std::span<const IsoTriangle> triangles,
                 const Share& share, ChunkResult& result) {
  const auto count = static_cast<std::uint32_t>(record.vertices.size());
  for (const IsoTriangle& triangle : triangles) {
    const std::uint32_t a = triangle[0].bits, b = triangle[1].bits, c = triangle[2].bits;
    if (a >= count || b >= count || c >= count) [[unlikely]] {  // of the next slab, or wrong: checked later
      result.border.push_back(triangle);
      continue;
    }
    const std::uint32_t ca = tables.vertices[0][a].corner, cb = tables.vertices[0][b].corner,
                        cc = tables.vertices[0][c].corner;
    if (((ca | cb | cc) & kNext) != 0) {
      result.border.push_back(triangle);
      continue;
    }
    const bool owned = share.owns_vertex(a) && share.owns_vertex(b) && share.owns_vertex(c) && share.owns_corner(ca) &&
                       share.owns_corner(cb) && share.owns_corner(cc);
    if (owned) {
      count_triangle<mode, false>(tables, triangle);
    } else {
      result.deferred.push_back(triangle);
    }
  }
}

/// Shares follow the triangles: each begins at the vertex and corner its first triangle names, so that with triangles,
/// vertices and corners all in tile order few triangles are left over. Any choice is right, a bad one only slower.
std::vector<Share> make_shares(const SlabRecord& record, std::size_t chunks) {
  std::vector<Share> shares(chunks);
  if (chunks == 1) return shares;
  const std::vector<IsoTriangle>& triangles = record.iso->triangles;
  const auto vertex_count = static_cast<std::uint32_t>(record.vertices.size());
  std::vector<std::uint32_t> vertex(chunks + 1, 0), corner(chunks + 1, 0);
  for (std::size_t chunk = 1; chunk < chunks; ++chunk) {
    std::uint32_t v = vertex_count, c = static_cast<std::uint32_t>(record.corners.size());
    for (const SlabIndex index : triangles[triangles.size() * chunk / chunks]) {
      if (index.bits >= vertex_count) continue;
      v = std::min(v, index.bits);
      if (!record.vertices[index.bits].crossing()) c = std::min(c, record.vertices[index.bits].corner);
    }
    vertex[chunk] = std::max(vertex[chunk - 1], v);
    corner[chunk] = std::max(corner[chunk - 1], c);
  }
  vertex[chunks] = corner[chunks] = SlabIndex::kNextSlab;
  for (std::size_t chunk = 0; chunk < chunks; ++chunk) {
    shares[chunk] = {vertex[chunk], vertex[chunk + 1] - vertex[chunk], corner[chunk],
                     corner[chunk + 1] - corner[chunk]};
  }
  return shares;
}

void check_border(const SlabRecord& here, const SlabRecord& next) {
  for (const IsoTriangle& triangle : here.border) {
    for (const SlabIndex index : triangle) {
      const SlabRecord& table = index.next() ? next : here;
      if (index.index() >= table.vertices.size()) {
        bad_slab(here.slab, "a triangle names isovertex " + std::to_string(index.index()) + " of slab " +
                                std::to_string(table.slab) + ", which has " + std::to_string(table.vertices.size()));
      }
      if (index.next() && table.vertices[index.index()].crossing()) {
        bad_slab(here.slab, "a triangle names an isovertex that belongs to a corner two slabs on");
      }
    }
  }
}

template <ClusterMode mode>
void count_as(Window& window, std::int64_t slab) {
  SlabRecord& here = window.at(slab);
  SlabRecord& next = window.at(slab + 1);
  if (here.next_corners > next.corners.size()) {
    bad_slab(slab, "an isovertex names corner " + std::to_string(here.next_corners - 1) +
                       " of the next slab, which has " + std::to_string(next.corners.size()));
  }
  const Tables tables{{here.vertices.data(), next.vertices.data()},
                      {here.corners.data(), next.corners.data()},
                      {slab_tag(slab), slab_tag(slab + 1)}};
  const std::span<const IsoTriangle> triangles(here.iso->triangles);
  const std::size_t chunks = chunk_count(triangles.size(), kLeastCounted);
  const std::vector<Share> shares = make_shares(here, chunks);
  std::vector<ChunkResult> results(chunks);
  for_chunks(triangles.size(), chunks, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    count_chunk<mode>(here, tables, triangles.subspan(begin, end - begin), shares[chunk], results[chunk]);
  });
  here.border.clear();
  for (const ChunkResult& result : results) {
    here.border.insert(here.border.end(), result.border.begin(), result.border.end());
    for (const IsoTriangle& triangle : result.deferred) count_triangle<mode, false>(tables, triangle);
  }
  check_border(here, next);
  for (const IsoTriangle& triangle : here.border) count_triangle<mode, true>(tables, triangle);
}

}  // namespace

void lay_out(SlabRecord& record, std::shared_ptr<const IsoSlab> iso) {
  record.slab = iso->slab;
  record.iso = std::move(iso);
  const std::vector<IsoVertex>& vertices = record.iso->vertices;
  const std::vector<SurfaceCorner>& corners = record.iso->corners;
  if (vertices.size() > kRefIndex || corners.size() > kRefIndex) {
    throw Error(ExitCode::budget, "clustering: slab " + std::to_string(record.slab) + " holds more than " +
                                      std::to_string(kRefIndex) + " isovertices; use larger cells");
  }
  record.next_corners = 0;
  record.crossing.clear();
  record.border.clear();
  record.unresolved.clear();
  record.unresolved_triangles.clear();
  resize_anew(record.corners, corners.size());
  record.verdicts.assign(corners.size(), Verdict::kept);
  record.vetoes.assign(corners.size(), 0);
  record.seats.assign(corners.size(), kNone);
  resize_anew(record.vertices, vertices.size());
  for_chunks(corners.size(), chunk_count(corners.size(), kLeastCounted),
             [&](std::size_t, std::size_t begin, std::size_t end) {
               for (std::size_t c = begin; c < end; ++c) {
                 CornerNote note;
                 note.slot = slot_of(corners[c]);
                 record.corners[c] = note;
               }
             });
  for (std::size_t v = 0; v < vertices.size(); ++v) {
    const IsoVertex& vertex = vertices[v];
    const auto beyond = [&](SlabIndex i) { return !i.next() && i.bits >= corners.size(); };
    if (beyond(vertex.low) || beyond(vertex.high)) {
      bad_slab(record.slab, "isovertex " + std::to_string(v) + " names a corner beyond the slab's " +
                                std::to_string(corners.size()));
    }
    VertexNote note;
    // Looked up, not asked for: which end is the nearer one is as good as random.
    const std::size_t end = vertex.near_high ? 1 : 0;
    note.direction = static_cast<std::uint8_t>(2 * (vertex.axis % 3) + end);
    note.corner = std::array{vertex.low.bits, vertex.high.bits}[end];
    record.vertices[v] = note;
    if (vertex.high.next()) record.next_corners = std::max(record.next_corners, vertex.high.index() + 1);
    if (note.crossing()) record.crossing.push_back(static_cast<std::uint32_t>(v));
  }
}

void count_triangles(Window& window, std::int64_t slab, ClusterMode mode) {
  switch (mode) {
    case ClusterMode::none:
      return count_as<ClusterMode::none>(window, slab);
    case ClusterMode::free:
      return count_as<ClusterMode::free>(window, slab);
    case ClusterMode::preserving:
      return count_as<ClusterMode::preserving>(window, slab);
  }
}

}  // namespace lamina::clustering
