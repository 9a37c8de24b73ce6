// Joins the edges of rims to closed loops, whatever the order in which they come.
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <unordered_map>
#include <vector>

#include "boundary/rim.h"

namespace lamina::holes {

/// A rim, or as much of it as is known.
struct RimExtent {
  std::uint64_t edges = 0;
  double length = 0;  ///< input units
  double radii = 0;   ///< the same in local influence radii
  std::array<double, 3> low{}, high{};
  [[nodiscard]] std::array<double, 3> middle() const {
    return {0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.5 * (low[2] + high[2])};
  }
};

/// Memory holds the vertices of rims that are open still, and no longer than `longest`: of longer ones only the ends.
class RimPaths {
 public:
  /// `closed` gets loops of at most about `longest` radii and kMostEdges edges, `left` all others in the end.
  /// `attributes`: of each vertex.
  RimPaths(double longest, std::size_t attributes, std::function<void(Loop&&, const RimExtent&)> closed,
           std::function<void(const RimExtent&)> left);
  static constexpr std::uint64_t kMostEdges = 512;

  /// `first`: what the piece's numbers count from. Loose edges are not looked at.
  void add(const RimPiece& piece, Number first);
  /// Forgets vertices below `number` that have no edge.
  void forget_below(Number number);
  /// No more edges come; rims that never closed are left.
  void finish();

 private:
  static constexpr Number kNone = std::numeric_limits<Number>::min();
  struct Node {
    RimVertex vertex;
    std::vector<float> attributes;
    std::vector<Number> inner;
    Number next = kNone;  ///< along the rim's edges
    bool entered = false;
    std::array<double, 3> facing{};  ///< of the edge to `next`
  };
  struct Path {
    Number first = 0, last = 0;
    RimExtent extent;
    bool dropped = false;  ///< only its ends are known
  };
  void join(const RimEdge& edge);
  std::optional<Path> take_ending(Number vertex);
  std::optional<Path> take_beginning(Number vertex);
  void erase_between(Number first, Number last);
  Loop take_loop(const Path& path);

  double longest_;
  std::size_t attributes_;
  std::function<void(Loop&&, const RimExtent&)> closed_;
  std::function<void(const RimExtent&)> left_;
  std::unordered_map<Number, Node> nodes_;
  std::unordered_map<Number, Path> by_first_;  ///< open paths by their first vertex
  std::unordered_map<Number, Number> last_to_first_;
};

}  // namespace lamina::holes
