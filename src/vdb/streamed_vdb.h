// A .vdb file written leaf by leaf, in any order: OpenVDB's own writer wants the whole tree in memory. Leaves are made
// as they stand in files, without a leaf of OpenVDB's in between.
#pragma once
#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "base/output_file.h"
#include "base/spill_file.h"
#include "lattice/block_mask.h"
#include "vdb/grids.h"

namespace lamina::volume {

/// A leaf as it will stand in the file.
struct PackedLeaf {
  openvdb::Coord origin;
  std::array<std::int8_t, 6> faces{};  ///< LeafVotes::faces
  std::uint32_t active = 0;
  openvdb::CoordBBox box;  ///< of the active voxels
  std::string bytes;
};

/// Masks in the order of OpenVDB's leaves: word x, bit 8 y + z.
struct LeafMasks {
  BlockMask active;
  BlockMask inside;  ///< of the voxels that are not active: minus the background; empty where that is 0
};

/// `values` of the active voxels in the mask's order, `width` (1 or 3) for each. `out` may be an older leaf, whose
/// memory is used again; its faces have no opinion. Safe from several threads.
void pack(const openvdb::Coord& origin, const LeafMasks& masks, std::span<const float> values, int width, bool half,
          PackedLeaf& out);

/// How a leaf's faces vote for the tiles beside them (LeafVotes::faces). `negative`: active voxels inside, those that
/// are not active where LeafMasks::inside is set.
std::array<std::int8_t, 6> face_votes(const BlockMask& active, const BlockMask& negative);
std::array<std::int8_t, 6> face_votes(const openvdb::FloatTree::LeafNodeType& leaf);

// Which empty places between the leaves of a narrow band lie inside: what OpenVDB keeps as the signs of tiles.

/// A leaf's place in units of leaves (8 voxels), and how its faces vote: negative when the voxels there are inside.
struct LeafVotes {
  std::array<std::int32_t, 3> leaf{};
  std::array<std::int8_t, 6> faces{};  ///< low and high end of axis 0, 1, 2; 0: no opinion
};

/// A tile beside leaves takes their sign. A region of tiles that leaves enclose takes the sign of the leaves around it;
/// one that is connected with the outside counts as outside, but for two tiles next to leaves that say otherwise: there
/// the surface is open and nothing is known farther away.
class TileSigns {
 public:
  using Place = std::array<std::int32_t, 3>;
  static constexpr int kSlots = 16 * 16 * 16;  ///< leaves in a node: OpenVDB's lower internal node, 128 voxels wide

  explicit TileSigns(const std::vector<LeafVotes>& leaves);
  /// Of the leaf-sized tiles of a node that has leaves, [x][y][z]; `node` in units of nodes.
  [[nodiscard]] const std::uint8_t* inside_tiles(const Place& node) const;
  /// Of a node without leaves.
  [[nodiscard]] bool inside(const Place& node) const;

 private:
  enum State : std::uint8_t { kUnknown, kLeaf, kOutside, kInside };
  struct Node {
    std::vector<std::uint8_t> state;  ///< in the end 1 where the tile lies inside, 0 elsewhere
    std::vector<std::int8_t> votes;
  };
  struct Slot {
    std::uint32_t cell;  ///< of the grid of nodes
    std::uint32_t slot;  ///< kSlots: the whole empty node
  };
  [[nodiscard]] std::uint32_t cell_of(const Place& node) const;
  void vote(const LeafVotes& leaf);
  template <class Visit>
  void for_each_neighbour(const Slot& s, const Visit& visit) const;
  void flood(const Slot& seed, bool outside);
  void spread_local();
  std::uint8_t& state(const Slot& s);
  [[nodiscard]] std::int32_t vote_of(const Slot& s) const;

  Place low_{}, size_{};               ///< of the grid of nodes, one empty node around all of them
  std::vector<std::int32_t> node_at_;  ///< index into nodes_, or -1
  std::vector<std::uint8_t> empty_;    ///< state of the nodes without leaves
  std::map<std::uint32_t, std::int32_t> empty_votes_;
  std::vector<Node> nodes_;
};

/// Decides anew which tiles of a grid lie inside, from the leaves beside them.
void sign_tiles(openvdb::FloatGrid& grid);

/// Leaves wait, compressed, in an unnamed temporary file; memory holds some forty bytes for each. finish() puts the
/// file together, commit() gives it its name. Without commit() nothing is left.
class StreamedVdb {
 public:
  StreamedVdb(std::string path, const std::string& tmp_dir);
  StreamedVdb(const StreamedVdb&) = delete;
  StreamedVdb& operator=(const StreamedVdb&) = delete;

  /// An empty FloatGrid or Vec3SGrid that carries name, background, transform and metadata; returns its number. A float
  /// grid's tiles get the signs of the leaves around (TileSigns) when it is a level set.
  std::size_t add_grid(const openvdb::GridBase::Ptr& empty);
  /// Each place once. Those of a node of 128^3 voxels are read fastest when they came one after the other.
  void add(std::size_t grid, const PackedLeaf& leaf);
  [[nodiscard]] std::uint64_t leaves() const;
  /// Writes everything, with a tag made from the contents. Throws Error(budget) when the disk does not take it.
  void finish();
  void commit(const std::string& final_name);
  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }
  [[nodiscard]] openvdb::GridBase& grid(std::size_t number) { return *grids_[number].empty; }

 private:
  static constexpr std::size_t kBuffersInFlight = 16;
  struct Record {
    LeafVotes place;
    std::uint32_t size = 0;
    std::uint64_t at = 0;
  };
  struct Grid {
    openvdb::GridBase::Ptr empty;
    std::vector<Record> leaves;
    std::uint64_t active = 0;
    openvdb::CoordBBox box;
  };
  template <class Tree>
  class Topology;
  void write(std::ostream& os);
  void write_grid(std::ostream& os, const Grid& grid) const;
  void write_buffers(std::ostream& os, const Grid& grid) const;
  template <class Visit>
  void visit_records(std::span<const Record> records, const Visit& visit) const;
  [[noreturn]] void fail(const char* what) const;

  std::string path_;
  StagedFile staged_;
  SpillFile spool_;
  BackgroundWriter disk_{SpillFile::kBufferBytes, kBuffersInFlight};  ///< ends before the file it writes to
  std::vector<Grid> grids_;
  std::uint64_t bytes_ = 0;
};

}  // namespace lamina::volume
