// The graph of patches, pieces of the surface within which the signs of normals are settled: what neighbouring ones say
// about each other, what can be seen from where, and the signs that follow. A scanner stood on a side from which one
// looks far, and what it saw lies open to that side.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "lamina/frame.h"
#include "lamina/normals.h"
#include "meshes/vec3.h"

namespace lamina::normals {

/// Sums over a patch's samples, signs relative to the patch. Lengths in kUnit steps of the frame.
struct PatchNode {
  static constexpr double kUnit = 1 << 29;
  std::uint32_t count = 0;
  float area = 0;                  ///< kUnit^2
  std::array<float, 3> centre{};   ///< by area
  std::array<float, 3> outward{};  ///< normals, by area
  float bulge = 0;                 ///< normal times offset from the centre, by area
  float vote = 0;                  ///< cosines to the viewpoints
};

/// What the links between two patches come to.
struct PatchEdge {
  std::uint32_t a = 0, b = 0;            ///< a < b
  float agreement = 0;                   ///< sum over links; below 0: one of the two must turn
  std::uint32_t same = 0, opposite = 0;  ///< links along the surface, by their normals as they are
};

/// Links of a slab whose signs no patch decides.
struct SlabLinks {
  std::uint64_t same = 0, opposite = 0;
  std::size_t edge_end = 0;  ///< the slab's edges end there
};

struct PatchGraph {
  float cell = 0;  ///< side of the cubes that patches lie in, kUnit steps; 0: nothing is known of what they hide
  std::vector<PatchNode> nodes = std::vector<PatchNode>(1);  ///< the first is kFixed: it cannot turn
  std::vector<PatchEdge> edges;
  std::vector<SlabLinks> slabs;
};

/// How a patch's sign was found.
enum class SignSource : std::uint8_t {
  fixed,    ///< linked to the fixed node, by votes or by given normals
  outside,  ///< the surface encloses a volume
  inside,   ///< the same, but what is in it was seen from inside
  up,       ///< ground of a wide and flat cloud
  sight,    ///< one looks farther from this side
  unsure,   ///< too open, or encloses little
};

/// The input's x, y and z in the frame, unit length.
using InputAxes = std::array<std::array<float, 3>, 3>;

struct PatchSigns {
  std::vector<std::int8_t> sign;  ///< by node: 1 or -1
  std::vector<SignSource> source;
  std::uint64_t components = 0;
};

/// Chooses signs so that as many links as possible agree: a spanning tree in Boruvka's rounds, where every cluster of
/// patches joins the one that it has most to say about, for or against, and the sums are taken anew between the
/// clusters. Votes are links to the fixed node. Clusters whose links contradict each other too much to follow wait
/// until those that enclose a volume have been turned outside out, or inside out if it is a room. What then still is
/// not joined to the fixed node gets its side by itself (Sides). Deterministic.
PatchSigns find_signs(const PatchGraph& graph, const InputAxes& axes);

/// Conflicts that remain, by slab.
std::vector<SignConflicts> count_conflicts(const PatchGraph& graph, const PatchSigns& signs);

/// Rows from `first` on, up to the next one's, were seen from `viewpoint`, where there is one.
struct SeenFrom {
  std::uint64_t first = 0;
  bool known = false;
  Viewpoint viewpoint;
};

/// Where the parts of an input were seen from, as its file or the settings say; rows ascending.
std::vector<SeenFrom> scanners_of(const PointSourceInfo& info, const NormalsSettings& settings);

/// A sample's vote counts for so many links where all is seen from one direction, as from the air: what links say
/// between crowns and what lies below them is often wrong. Of a town's samples 5.5 % face down without votes, with
/// one 1.4, with four 0.9, with sixteen 0.8.
inline constexpr double kFromFar = 4;

class Viewpoints {
 public:
  /// `everywhere`: of rows that `by_row` (ascending) knows nothing about; each sample takes the nearest.
  Viewpoints(const std::vector<Viewpoint>& everywhere, const std::vector<SeenFrom>& by_row, const Frame& frame);
  [[nodiscard]] bool any() const { return any_; }
  /// Cosine between the normal and the line of sight to the viewer, kFromFar times that where the viewer is far away; 0
  /// where nothing is known. Steps of the frame.
  [[nodiscard]] float vote(std::uint64_t row, const std::array<std::int32_t, 3>& at,
                           const std::array<float, 3>& normal) const;

 private:
  struct Local {
    std::array<double, 3> at{};
    bool direction = false;
  };
  struct Rows {
    std::uint64_t first = 0;
    bool known = false;
    Local viewpoint;
  };
  static Local local(const Viewpoint& viewpoint, const Frame& frame);
  std::vector<Local> everywhere_;
  std::vector<Rows> by_row_;
  bool any_ = false;
};

// Where patches are, in cubes, and how far one can look between them.

class Occupancy {
 public:
  /// What lies nearer to a patch than so many cubes may be its own surface.
  static constexpr double kClear = 1.8;
  /// Patches of fewer samples are strays that hide nothing.
  static constexpr std::uint32_t kLeastCount = 4;

  /// Cubes have the size of the graph's cells, or more where these would be too many. Empty where the cells have no
  /// size.
  explicit Occupancy(const PatchGraph& graph);

  [[nodiscard]] bool empty() const { return taken_.empty(); }
  [[nodiscard]] double side() const { return side_; }          ///< of a cube, kUnit steps
  [[nodiscard]] double diagonal() const { return diagonal_; }  ///< of the cloud, cubes
  /// In cubes from the corner.
  [[nodiscard]] meshes::Vec3 place(const PatchNode& node) const;
  /// How many cubes one can look from a place until one that is taken; far more than the diagonal where none is.
  [[nodiscard]] double way(const meshes::Vec3& at, const meshes::Vec3& direction) const;

 private:
  using Cube = std::array<std::ptrdiff_t, 3>;
  [[nodiscard]] std::size_t index(const Cube& cube) const {
    return static_cast<std::size_t>((cube[2] * size_[1] + cube[1]) * size_[0] + cube[0]);
  }

  meshes::Vec3 origin_{};
  double side_ = 1;
  double diagonal_ = 1;
  Cube size_{};
  std::vector<bool> taken_;
};

/// To one side of a patch.
struct View {
  float open = 1;  ///< share of the directions in which no other patch lies; also eighty degrees from the normal
  float way = 1;   ///< mean way to the next one within sixty degrees, of the cloud's diagonal; 1 where there is none

  /// But for a crack nothing of the open is seen.
  [[nodiscard]] bool is_closed() const { return open < 0.03F; }
};

/// Of a patch as its normals are.
struct Sight {
  View front, back;
};

/// By node: for how many patches of its body a patch is looked from; 0: it is not, another one stands for it. A body of
/// tens of thousands is known by a few thousand. Patches that have the fixed node for a root need no look.
std::vector<float> choose_looks(const std::vector<std::uint32_t>& root);

/// Looks around from the patches that are chosen. What lies nearer than about two cubes hides nothing: it may be the
/// patch's own surface. All is open where nothing is known of what patches hide.
std::vector<Sight> look_around(const PatchGraph& graph, const Occupancy& around, const std::vector<float>& looks);

// How much of a closed surface could have been scanned from a few places inside: nearly all of a room, but less of a
// thing with limbs, holes or folds.

/// A patch, as it would face if it had been seen from within.
struct Wall {
  meshes::Vec3 at{};  ///< Occupancy::place()
  meshes::Vec3 facing{};
  double area = 0;  ///< square cubes
};

/// The share of the area that four places see together. 0 for so few walls that cubes are too coarse a picture.
double share_seen_within(const Occupancy& around, const std::vector<Wall>& walls);

/// Places half way between opposite walls, some hundred all over the room.
std::vector<meshes::Vec3> places_within(const Occupancy& around, const std::vector<Wall>& walls);

/// For each patch, whichever way it faces, from which side the places see it, -1..1 (below 0: from behind); 0 where
/// many see it from either side, as the back of a chair, and where none sees it. What another stands close before is
/// not seen, so that each face of a board is seen from its own side.
std::vector<double> votes_from_within(const Occupancy& around, const std::vector<meshes::Vec3>& places,
                                      const std::vector<Wall>& patches);

// Which side of a surface is outside, or was seen, where neither a scanner nor given normals say it.

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
  /// A sheet that lies across a direction, as ground does.
  [[nodiscard]] bool is_sheet(const std::array<double, 3>& across) const;
};

/// A side, and why.
struct Side {
  bool turn = false;
  SignSource source = SignSource::unsure;
};

class Sides {
 public:
  Sides(const PatchGraph& graph, const InputAxes& axes, std::vector<float> looks);

  /// By root.
  [[nodiscard]] std::vector<Body> bodies(const std::vector<std::uint32_t>& root,
                                         const std::vector<std::int8_t>& sign) const;
  /// The closed body that was seen from inside, if there is one: a room. A part of it, or of what stands in it, would
  /// face dead ends if its outside were out, and four places inside see nearly all of it. What is a closed body of its
  /// own, as the kernel of a nut is, tells nothing.
  [[nodiscard]] std::optional<std::uint32_t> find_room(const std::vector<Body>& bodies,
                                                       const std::vector<std::uint32_t>& root,
                                                       const std::vector<std::int8_t>& sign) const;
  /// What places inside the room say of each patch that is not fixed, in the unit of PatchNode::vote.
  [[nodiscard]] std::vector<float> votes_from_within(const Body& room, std::uint32_t room_root,
                                                     const std::vector<std::uint32_t>& root,
                                                     const std::vector<std::int8_t>& sign) const;
  /// Whether all was seen from above, as terrain is from the air: level ground that what stands on it hides little of,
  /// and hardly a wall, which whoever stands on the ground sees.
  [[nodiscard]] bool seen_from_above(const std::vector<Body>& bodies, const std::vector<std::uint32_t>& root) const;
  /// What is seen from above and not fixed faces up; in the unit of PatchNode::vote.
  [[nodiscard]] std::vector<float> votes_from_above(const std::vector<std::uint32_t>& root) const;
  /// Of a body that no link joins to a side.
  [[nodiscard]] Side choose(const Body& body) const;

 private:
  /// Patches of a closed body, facing what it encloses.
  [[nodiscard]] std::vector<Wall> walls_of(const Body& body, std::uint32_t body_root,
                                           const std::vector<std::uint32_t>& root,
                                           const std::vector<std::int8_t>& sign) const;
  [[nodiscard]] std::optional<Wall> wall_of(std::uint32_t patch) const;

  const PatchGraph& graph_;
  Occupancy around_;
  std::vector<float> looks_;
  std::vector<Sight> sights_;
  std::array<double, 3> up_{};                 ///< of the input
  std::optional<std::array<double, 3>> flat_;  ///< across a cloud that is wide and flat
  bool is_level_ = false;                      ///< and level, as terrain is
};

/// A surface that encloses a positive volume has its normals outward.
bool is_inside_out(const Body& body);

}  // namespace lamina::normals
