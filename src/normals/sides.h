// Which side of a surface is outside, or was seen, where neither a scanner nor given normals say it.
#pragma once
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "normals/patch_graph.h"
#include "normals/sight.h"

namespace lamina::normals {

/// Sums over the patches of a surface, with the signs found so far.
struct Body {
  double area = 0;
  std::array<double, 3> moment{};  ///< area times centre
  std::array<double, 3> facing{};  ///< area times normal: zero for what is closed
  double volume = 0, size = 0;
  double counted = 0;   ///< area without what strays stand for
  double skyward = 0;   ///< of this, where the sky is open above, times how much it faces up
  double seen = 0;      ///< of this, times what sight says for the side that it faces
  double shut_in = 0;   ///< area whose front sees nothing of the open, less than its back does
  double shut_out = 0;  ///< the same of its back
  std::uint64_t samples = 0;

  /// How much of it faces one way, 0..1.
  [[nodiscard]] double openness() const;
  /// Closed, and with an inside worth the name.
  [[nodiscard]] bool encloses() const;
};

/// A side, and why.
struct Side {
  bool turn = false;
  SignSource source = SignSource::unsure;
};

class Sides {
 public:
  Sides(const PatchGraph& graph, const InputAxes& axes, const std::vector<std::uint8_t>& open);

  /// By root.
  [[nodiscard]] std::vector<Body> bodies(const std::vector<std::uint32_t>& root,
                                         const std::vector<std::int8_t>& sign) const;
  /// The closed body that was seen from inside, if there is one: a room. A part of it, or of what stands in it, would
  /// face dead ends if its outside were out, and four places inside see nearly all of it. What is a closed body of its
  /// own, as the kernel of a nut is, tells nothing.
  [[nodiscard]] std::optional<std::uint32_t> find_room(const std::vector<Body>& bodies,
                                                       const std::vector<std::uint32_t>& root,
                                                       const std::vector<std::int8_t>& sign) const;
  /// Of a body that no link joins to a side.
  [[nodiscard]] Side choose(const Body& body) const;

 private:
  /// Patches as they are signed.
  [[nodiscard]] std::vector<Wall> walls_of(std::uint32_t body, const std::vector<std::uint32_t>& root,
                                           const std::vector<std::int8_t>& sign) const;

  const PatchGraph& graph_;
  Occupancy around_;
  std::vector<Sight> sights_;
  std::array<double, 3> up_{};                 ///< of the input
  std::optional<std::array<double, 3>> flat_;  ///< across a cloud that is wide and flat
  bool is_level_ = false;                      ///< and level, as terrain is
};

/// A surface that encloses a positive volume has its normals outward.
bool is_inside_out(const Body& body);

}  // namespace lamina::normals
