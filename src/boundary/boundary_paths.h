// Joins the edges of boundary loops to closed loops, whatever the order in which they come.
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <unordered_map>
#include <vector>

#include "boundary/boundary.h"

namespace lamina::boundary {

/// A boundary loop, or as much of it as is known.
struct LoopExtent {
  std::uint64_t edges = 0;
  double length = 0;  ///< input units
  double radii = 0;   ///< the same in local influence radii
  std::array<double, 3> low{}, high{};
  [[nodiscard]] std::array<double, 3> middle() const {
    return {0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.5 * (low[2] + high[2])};
  }
};

/// Memory holds the vertices of boundary loops that are open still, and no longer than `longest`: of longer ones only
/// the ends.
class BoundaryPaths {
 public:
  struct Bounds {
    double longest = 0;       ///< radii, about
    std::uint64_t edges = 0;  ///< at most
  };
  /// `closed` gets loops within the bounds, `left` all others in the end. `attributes`: of each vertex.
  BoundaryPaths(const Bounds& bounds, std::size_t attributes, std::function<void(Loop&&, const LoopExtent&)> closed,
                std::function<void(const LoopExtent&)> left);
  /// Lengths are summed up in the order of coming: what is just about too long is for the closer to decide.
  static constexpr double kRoundedUp = 1.001;

  /// `first`: what the batch's numbers count from. Loose edges are not looked at.
  void add(const BoundaryBatch& batch, Number first);
  /// Forgets vertices below `number` that have no edge.
  void forget_below(Number number);
  /// No more edges come; boundary loops that never closed are left.
  void finish();

 private:
  static constexpr Number kNone = std::numeric_limits<Number>::min();
  struct Node {
    BoundaryVertex vertex;
    std::vector<float> attributes;
    std::vector<Number> inner;
    Number next = kNone;  ///< along the boundary loop's edges
    bool entered = false;
    std::array<double, 3> facing{};  ///< of the edge to `next`
  };
  struct Path {
    Number first = 0, last = 0;
    LoopExtent extent;
    bool dropped = false;  ///< only its ends are known
  };
  void join(const BoundaryEdge& edge);
  std::optional<Path> take_ending(Number vertex);
  std::optional<Path> take_beginning(Number vertex);
  void erase_between(Number first, Number last);
  Loop take_loop(const Path& path);

  Bounds bounds_;
  std::size_t attributes_;
  std::function<void(Loop&&, const LoopExtent&)> closed_;
  std::function<void(const LoopExtent&)> left_;
  std::unordered_map<Number, Node> nodes_;
  std::unordered_map<Number, Path> by_first_;  ///< open paths by their first vertex
  std::unordered_map<Number, Number> last_to_first_;
};

}  // namespace lamina::boundary
