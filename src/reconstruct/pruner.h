// Leaves out the small connected parts of a mesh while it streams by.
#pragma once
#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "base/spill_file.h"
#include "lamina/surface.h"
#include "meshes/mesh_sink.h"
#include "reconstruct/mesh_output.h"

namespace lamina {

/// What makes a part small; a part that is small by any of them is left out.
struct PruneRule {
  std::uint64_t triangles = 0;  ///< fewer than this; 0: any number will do
  std::uint64_t samples = 0;    ///< fewer than this lie under it, by VertexBatch::density; 0: any number will do
  double size = 0;              ///< the diagonal of its box, input axes, is shorter than this; 0: any size will do

  [[nodiscard]] bool wanted() const { return triangles > 0 || samples > 0 || size > 0; }
};

/// Takes a mesh slab by slab and passes on to a sink what stays, vertices and triangles in the order in which they came
/// and numbered anew. A part is known to be large as soon as it has grown so far, and known to be small once the sweep
/// has left it; until then it and what came after it waits, beyond some megabytes in an unnamed file. A part that is
/// small by its size ends within that length of the sweep, one of few triangles within as many cells, one of few
/// samples within as many supports: what waits is bounded by that, not by the mesh. Memory otherwise holds four bytes
/// for each vertex of a slab (32 where samples are asked for) and a record for each part of the slabs that wait.
///
/// The bytes that come out do not depend on how much was kept in memory.
class Pruner {
 public:
  using Triangles = std::vector<std::array<std::uint32_t, 3>>;

  Pruner(const PruneRule& rule, std::string tmp_dir, SlabSink& sink, std::uint64_t memory_bytes = 32U << 20);

  /// The next slab. Triangles index vertices of this slab and of the one before, over all vertices added so far (else
  /// Error(internal)). Throws Error(budget) when the temporary file cannot grow, and what the sink throws.
  void add(const VertexBatch& vertices, const Triangles& triangles);
  /// No more slabs come: everything that stays is in the sink.
  void finish();

  [[nodiscard]] const PruneCounts& counts() const { return counts_; }
  /// Waiting in the file, now.
  [[nodiscard]] std::uint64_t disk_bytes() const { return file_ ? file_->size() - file_->begin() : 0; }

 private:
  enum class Fate : std::uint8_t { open, stays, goes };
  /// A part, as far as it is known; parts that have met point to the youngest of them.
  struct Part {
    std::uint64_t parent = 0;
    std::uint64_t triangles = 0;
    double samples = 0;  ///< under it
    std::array<double, 3> low{}, high{};
    Fate fate = Fate::open;
    bool ended = false;
  };
  struct Slab {
    std::uint64_t first = 0;       ///< number of its first vertex
    std::uint64_t first_part = 0;  ///< parts [first_part, end_part) are its own
    std::uint64_t end_part = 0;
    std::vector<std::uint32_t> part;  ///< of each vertex, counted from first_part
    VertexBatch vertices;
    Triangles triangles;
    std::uint64_t bytes = 0;  ///< of the arrays
    bool spilled = false;
    std::size_t spilled_triangles = 0;
    bool radii = false, fitted = false;  ///< vertices have them
  };

  [[nodiscard]] Part& part(std::uint64_t id) { return parts_[id - first_id_]; }
  std::uint64_t root(std::uint64_t id);
  void join(std::uint64_t a, std::uint64_t b);
  [[nodiscard]] double samples_under(const Slab& slab, const std::array<std::uint32_t, 3>& triangle) const;
  void find_parts(Slab& slab);
  void count_triangles(const Slab& slab);
  void end_part(std::uint64_t id);
  void end_parts(const Slab& live, std::uint64_t from);
  void judge(Part& part) const;
  [[nodiscard]] bool is_large(const Part& part) const;
  void hold(Slab&& slab);
  void pass_on_decided();
  void pass_on(Slab& slab);
  void spill(Slab& slab);
  void fetch(Slab& slab);

  PruneRule rule_;
  std::string tmp_dir_;
  SlabSink& sink_;
  std::uint64_t memory_;
  PruneCounts counts_;

  std::deque<Part> parts_;
  std::uint64_t first_id_ = 0;
  std::uint64_t vertices_ = 0;  ///< added

  // Of the slab added last: what the next one may refer to.
  std::uint64_t live_first_ = 0, live_first_part_ = 0, live_end_part_ = 0;
  std::vector<std::uint32_t> live_part_;
  VertexBatch live_vertices_;  ///< where they are and what lies under them, for PruneRule::samples

  std::deque<Slab> waiting_;
  std::uint64_t held_bytes_ = 0;   ///< of the waiting slabs in memory
  std::optional<SpillFile> file_;  ///< of the waiting slabs that are not in memory, in their order

  // Of the slab passed on last, and the one being passed on.
  std::uint64_t passed_first_ = 0;
  std::vector<std::uint32_t> passed_number_;
  std::uint64_t written_ = 0;
};

}  // namespace lamina
