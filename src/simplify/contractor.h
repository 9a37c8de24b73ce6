// Edges of one piece of a mesh contracted, the cheapest first.
#pragma once
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "meshes/vec3.h"
#include "simplify/bound.h"
#include "simplify/old_mesh.h"
#include "simplify/quadric.h"
#include "simplify/stars.h"

namespace lamina::simplify {

/// Some triangles of a mesh, with vertices numbered anew.
struct Piece {
  std::vector<meshes::Vec3> positions;
  std::vector<Quadric> quadrics;    ///< of the vertices, about `centre`
  std::vector<std::uint8_t> fixed;  ///< vertices with triangles elsewhere: they stay
  std::vector<std::uint8_t> tried;  ///< vertices whose edges cannot go, unless one that has not been tried; empty: none
  std::vector<Triangle> triangles;
  meshes::Vec3 centre{};  ///< far from it quadrics lose their digits
  bool floats = false;    ///< positions are floats and stay so
  double bound = 0;       ///< how far it may get from the mesh that simplification began with; 0: as far as it likes
  std::vector<Errors> errors;  ///< of the triangles; empty without a bound
};

/// v has gone into u, `share` of the way from u to v.
struct Merge {
  std::uint32_t u, v;
  float share;
};

/// Contracts the edges of a piece by their quadric error, each to the point of least error. Depends on the piece alone.
class Contractor {
 public:
  explicit Contractor(Piece piece);

  /// What the next contraction costs, or a little less; nothing that is finite when none is left.
  [[nodiscard]] float next_cost();
  /// Contracts while the next one costs no more than `dearest` and more than `keep` triangles are there. Returns
  /// how many triangles went.
  std::uint64_t run(float dearest, std::uint64_t keep);

  /// Contractions of any cost are asked for from now on, in small steps.
  void expect_all() { raise_limit(std::numeric_limits<float>::infinity()); }

  /// With a bound: proves that it is kept, and takes contractions back where it may not be. The last thing to do.
  void prove();

  [[nodiscard]] std::uint64_t size() const { return size_; }  ///< triangles that are there
  [[nodiscard]] const std::vector<Merge>& merges() const { return merges_; }
  /// Of the triangles that are there; only behind prove().
  [[nodiscard]] const std::vector<Errors>& errors() const { return errors_; }
  /// Of all contractions so far the largest root mean square distance of a new vertex from the planes it stands for.
  [[nodiscard]] double deviation() const { return std::sqrt(deviation2_); }
  [[nodiscard]] const Stars& stars() const { return stars_; }
  [[nodiscard]] const Piece& piece() const { return piece_; }  ///< its triangles are in stars()

 private:
  /// In a heap with the cheapest on top, equal ones by their vertices.
  struct Entry {
    float cost;
    std::uint32_t u, v, version;
    bool operator<(const Entry& o) const {
      if (cost != o.cost) return cost > o.cost;
      return u != o.u ? u > o.u : v > o.v;
    }
  };

  /// What takes a contraction back; only with a bound.
  struct Step {
    std::uint32_t u, v;
    meshes::Vec3 place;  ///< of u
    Quadric quadric;
    Stars::Before before;
    std::size_t changes;  ///< where those of its triangles begin in earlier_
  };

  [[nodiscard]] bool stale(const Entry& e) const {
    return e.version != version_[e.u] + version_[e.v] || stars_.around(e.u).empty() || stars_.around(e.v).empty();
  }
  void raise_limit(float limit);
  void drop_stale();
  [[nodiscard]] Placed place(std::uint32_t u, std::uint32_t v) const;
  void offer(std::uint32_t u, std::uint32_t v);
  [[nodiscard]] bool surely_far(std::uint32_t u, std::uint32_t v, double cost) const;
  [[nodiscard]] bool stays_near(std::uint32_t u, std::uint32_t v, const Placed& to);
  int contract(std::uint32_t u, std::uint32_t v, const meshes::Vec3& to);
  void note(std::uint32_t u, std::uint32_t v);
  [[nodiscard]] bool tried(std::uint32_t v) const { return !piece_.tried.empty() && piece_.tried[v] != 0; }
  void keep_bound();
  void go_on(std::vector<std::uint32_t>& touched);
  void take_back(std::uint32_t step, std::vector<std::uint32_t>& touched);

  Piece piece_;
  Stars stars_;
  std::uint64_t size_;
  std::optional<OldMesh> old_;  ///< this and what follows only with a bound
  std::optional<Tracker> tracker_;
  std::vector<Step> steps_;             ///< one for each merge
  std::vector<std::uint32_t> change_;   ///< of triangles: the last step that changed them
  std::vector<std::uint32_t> earlier_;  ///< before a step: those of its triangles
  std::vector<Errors> errors_;
  std::vector<std::uint32_t> version_;  ///< how often a vertex has moved
  std::vector<Entry> heap_;             ///< what costs no more than limit_
  std::vector<Entry> later_;            ///< the other edges: most of them will be others before it is their turn
  float limit_ = -1;
  float least_later_ = std::numeric_limits<float>::infinity();  ///< cost of them, stale ones included
  std::vector<Merge> merges_;
  double deviation2_ = 0;
  std::vector<std::uint32_t> near_;
};

}  // namespace lamina::simplify
