#include "clustering/steps.h"

#include <algorithm>
#include <bit>

#include "clustering/resolve.h"

namespace lamina::clustering {
namespace {

constexpr std::size_t kDirections = 6;
using Adjacency = std::array<unsigned, kDirections>;

Adjacency unpack(unsigned edges) {
  Adjacency out{};
  unsigned bit = 1;
  for (std::size_t a = 0; a < kDirections; ++a) {
    for (std::size_t b = a + 1; b < kDirections; ++b, bit <<= 1) {
      if ((edges & bit) == 0) continue;
      out[a] |= 1U << b;
      out[b] |= 1U << a;
    }
  }
  return out;
}

/// The component of `seed` within `set`.
unsigned flood(const Adjacency& adjacency, unsigned set, unsigned seed) {
  unsigned reached = 0, front = seed;
  while (front != 0) {
    reached |= front;
    unsigned next = 0;
    for (unsigned f = front; f != 0; f &= f - 1) next |= adjacency[static_cast<std::size_t>(std::countr_zero(f))];
    front = next & set & ~reached;
  }
  return reached;
}

unsigned lowest(unsigned set) {
  return set & (0U - set);
}

constexpr std::size_t kLeastClassified = 1 << 13;
constexpr std::size_t kLeastUnresolved = 64;
/// Folds a used vertex into its cluster's note.
void fold(const VertexNote& vertex, CornerNote& corner) {
  if (!vertex.used()) return;
  const auto bit = static_cast<std::uint8_t>(1U << vertex.direction);
  const bool beyond = vertex.balance != 0 || (corner.members & bit) != 0;
  corner.members |= static_cast<std::uint8_t>(bit | (beyond ? CornerNote::kBeyond : 0));
  if ((vertex.marks & VertexNote::kThree) == 0) corner.idle |= bit;
}

/// Away from boundaries the sums prove C and R: the ring takes `ring_triangles` steps, and when as many distinct
/// neighbour clusters begin one, it is a simple cycle. That the cluster is no danger to its neighbours' Q comes with
/// it.
bool plainly_collapses(const CornerNote& note) {
  return (note.members & CornerNote::kBeyond) == 0 && note.ring_triangles >= 3 &&
         std::popcount(note.ring) == note.ring_triangles && plain_shape(note);
}

void fold_members(Window& window, std::int64_t slab) {
  SlabRecord& here = window.at(slab);
  const SlabRecord& below = window.at(slab - 1);
  for (const std::uint32_t v : below.crossing) {
    const VertexNote& vertex = below.vertices[v];
    fold(vertex, here.corners[vertex.corner & ~SlabIndex::kNextSlab]);
  }
  for (const VertexNote& vertex : here.vertices) {
    if (!vertex.crossing()) fold(vertex, here.corners[vertex.corner]);
  }
}

void list_unresolved(SlabRecord& here) {
  for (std::uint32_t c = 0; c < here.corners.size(); ++c) {
    const CornerNote& note = here.corners[c];
    if (note.members == 0) {
      here.verdicts[c] = Verdict::absent;
    } else if (plainly_collapses(note)) {
      here.verdicts[c] = Verdict::corner;
    } else {
      here.verdicts[c] = Verdict::unresolved;
      here.seats[c] = static_cast<std::uint32_t>(here.unresolved.size());
      here.unresolved.push_back({.corner = c, .first = 0, .count = 0, .components = {}});
    }
  }
}

/// Marks the vertices of this slab's unresolved clusters, so that finding their triangles costs one look per vertex.
void mark_vertices(Window& window, std::int64_t slab) {
  SlabRecord& here = window.at(slab);
  SlabRecord& below = window.at(slab - 1);
  const auto mark = [&](VertexNote& vertex) {
    if (here.verdicts[vertex.corner & ~SlabIndex::kNextSlab] == Verdict::unresolved)
      vertex.marks |= VertexNote::kUnresolved;
  };
  for (const std::uint32_t v : below.crossing) mark(below.vertices[v]);
  for_chunks(here.vertices.size(), chunk_count(here.vertices.size(), kLeastClassified),
             [&](std::size_t, std::size_t begin, std::size_t end) {
               for (std::size_t v = begin; v < end; ++v) {
                 if (!here.vertices[v].crossing()) mark(here.vertices[v]);
               }
             });
}

struct GatheredTriangle {
  std::uint32_t cluster;
  ClusterTriangle triangle;
};

/// Appends the triangle once for each unresolved cluster of `owner` it touches.
void gather(const Window& window, const SlabRecord& owner, const ClusterTriangle& triangle,
            std::vector<GatheredTriangle>& entries) {
  std::array<std::uint32_t, 3> cluster{kNone, kNone, kNone};
  for (std::size_t k = 0; k < 3; ++k) {
    const Ref corner = window.corner_of(triangle.vertex[k]);
    if (&window.record_of(corner) != &owner || owner.verdicts[corner & kRefIndex] != Verdict::unresolved) continue;
    cluster[k] = owner.seats[corner & kRefIndex];
    if (std::find(cluster.begin(), cluster.begin() + k, cluster[k]) == cluster.begin() + k)
      entries.push_back({cluster[k], triangle});
  }
}

void gather_range(const Window& window, const SlabRecord& owner, std::int64_t slab,
                  std::span<const IsoTriangle> triangles, std::vector<GatheredTriangle>& entries) {
  const std::array<Ref, 2> tag{slab_tag(slab), slab_tag(slab + 1)};
  const std::array<const VertexNote*, 2> notes{window.records[tag[0] >> kRefShift].vertices.data(),
                                               window.records[tag[1] >> kRefShift].vertices.data()};
  for (const IsoTriangle& t : triangles) {
    unsigned marks = 0;
    for (const SlabIndex index : t) marks |= notes[index.bits >> 31][index.index()].marks;
    if ((marks & VertexNote::kUnresolved) == 0) continue;
    ClusterTriangle triangle{};
    for (std::size_t k = 0; k < 3; ++k) triangle.vertex[k] = tag[t[k].bits >> 31] | t[k].index();
    gather(window, owner, triangle, entries);
  }
}

/// Lists for each unresolved cluster of `slab` the triangles that touch it, in mesh order.
void gather_triangles(Window& window, std::int64_t slab) {
  SlabRecord& here = window.at(slab);
  if (here.unresolved.empty()) return;
  const std::span<const IsoTriangle> triangles(here.iso->triangles);
  const std::size_t chunks = chunk_count(triangles.size(), kLeastClassified);
  std::vector<std::vector<GatheredTriangle>> entries(chunks + 1);
  gather_range(window, here, slab - 1, window.at(slab - 1).border, entries[0]);
  for_chunks(triangles.size(), chunks, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    gather_range(window, here, slab, triangles.subspan(begin, end - begin), entries[chunk + 1]);
  });
  for (const auto& part : entries) {
    for (const GatheredTriangle& entry : part) ++here.unresolved[entry.cluster].count;
  }
  std::uint32_t total = 0;
  for (UnresolvedCluster& cluster : here.unresolved) {
    cluster.first = total;
    total += cluster.count;
    cluster.count = 0;
  }
  here.unresolved_triangles.resize(total);
  for (const auto& part : entries) {
    for (const GatheredTriangle& entry : part) {
      UnresolvedCluster& cluster = here.unresolved[entry.cluster];
      here.unresolved_triangles[cluster.first + cluster.count++] = entry.triangle;
    }
  }
}

template <class Fn>
void for_unresolved(SlabRecord& here, const Fn& fn) {
  for_chunks(here.unresolved.size(), chunk_count(here.unresolved.size(), kLeastUnresolved),
             [&](std::size_t, std::size_t begin, std::size_t end) {
               ResolveScratch scratch;
               for (std::size_t h = begin; h < end; ++h) fn(here.unresolved[h], scratch);
             });
}

}  // namespace

bool plain_shape(const CornerNote& note) {
  const unsigned members = note.members, idle = note.idle;
  const int count = std::popcount(members);
  if (count + note.inner_triangles != std::popcount(note.edges) + 1) return false;
  // With V - E + F = 1, up to three members are connected: a second component would need one that holds an open cycle.
  if (count <= 3 && idle == 0) return true;
  const Adjacency adjacency = unpack(note.edges);
  if (flood(adjacency, members, lowest(members)) != members) return false;
  for (unsigned left = idle != 0 ? members : 0; left != 0; left &= left - 1) {
    const unsigned rest = members & ~lowest(left);
    for (unsigned open = rest; open != 0;) {
      const unsigned component = flood(adjacency, rest, lowest(open));
      if ((component & ~idle) == 0) return false;
      open &= ~component;
    }
  }
  return true;
}

void classify(Window& window, std::int64_t slab) {
  fold_members(window, slab);
  SlabRecord& here = window.at(slab);
  list_unresolved(here);
  mark_vertices(window, slab);
  gather_triangles(window, slab);
  for_unresolved(here, [&](UnresolvedCluster& cluster, ResolveScratch& scratch) {
    split_components(window, here, cluster, scratch);
    veto_neighbours(window, here, cluster, scratch);
  });
}

void decide(Window& window, std::int64_t slab) {
  SlabRecord& here = window.at(slab);
  for (std::size_t c = 0; c < here.verdicts.size(); ++c) {
    if (here.vetoes[c] != 0 && here.verdicts[c] == Verdict::corner) here.verdicts[c] = Verdict::kept;
  }
  for_unresolved(here, [&](UnresolvedCluster& cluster, ResolveScratch& scratch) {
    here.verdicts[cluster.corner] = resolve(window, here, cluster, scratch);
  });
}

}  // namespace lamina::clustering
