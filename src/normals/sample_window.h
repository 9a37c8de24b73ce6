// A window that slides over the slab store: the samples of one slab at a time and of what lies within its halo, with
// what has been found out about them.
#pragma once
#include <array>
#include <cstdint>
#include <deque>
#include <memory>
#include <span>
#include <vector>

#include "normals/sides.h"
#include "samples/sample_tree.h"
#include "store/slab_store.h"

namespace lamina::normals {

/// Node of the patch graph that every normal with a fixed sign belongs to.
inline constexpr std::uint32_t kFixed = 0;
/// Of samples that have no normal, or none yet.
inline constexpr std::uint32_t kNoNode = ~0U;

/// Parallel arrays. A normal's sign is relative to its patch: times the patch's sign it is the sample's.
struct WindowSamples {
  std::vector<std::int32_t> x, y, z;  ///< steps of the frame
  std::vector<float> nx, ny, nz;      ///< unit length, or zero
  std::vector<float> lift;            ///< from a noisy sample along its normal to its sheet, steps (height_of_sheet())
  std::vector<std::uint64_t> row;     ///< of the input
  std::vector<std::uint32_t> node;    ///< of the patch graph
  std::vector<std::uint8_t> given;    ///< 1: the normal comes from the input

  [[nodiscard]] std::size_t size() const { return x.size(); }
  [[nodiscard]] bool has_normal(std::size_t i) const { return nx[i] != 0 || ny[i] != 0 || nz[i] != 0; }
  void append(const WindowSamples& from, std::span<const std::uint32_t> which);
  /// Sample i becomes from[order[i]].
  void gather(const WindowSamples& from, std::span<const std::uint32_t> order);
};

/// The samples of the slab itself, and to which of their neighbours each is linked.
struct Links {
  static constexpr std::size_t kMost = 8;
  std::vector<std::uint32_t> core;                           ///< their places in the window, ascending
  std::vector<std::array<std::uint32_t, kMost>> neighbours;  ///< places; unused ones repeat the sample itself
  std::vector<float> scale;  ///< squared distance of the farthest neighbour taken, steps^2
};

struct WindowSettings {
  std::int32_t halo = 1;  ///< steps to either side of the slab that the window shows
  /// Of a slab, unless the store ends: buckets are taken together until they hold enough.
  std::uint64_t least_samples = 1;
  std::int32_t least_height = 1;  ///< steps, likewise
};

/// Buckets [first, end) of the store, worked on together.
struct Slab {
  std::size_t first = 0, end = 0;
  std::int64_t low = 0, high = -1;  ///< z of its lowest and highest sample
  std::uint64_t samples = 0;
};

/// The slab that begins with a bucket: empty (high below low) where nothing is left.
Slab slab_from(const SlabStore& store, const WindowSettings& settings, std::size_t first);

/// The most samples that the window will show at once, and those of them that are its slab's.
struct WindowCounts {
  std::uint64_t window = 0, slab = 0;
};
WindowCounts largest_window(const SlabStore& store, const WindowSettings& settings);

class SampleWindow {
 public:
  SampleWindow(const SlabStore& store, const WindowSettings& settings);

  /// Goes on to the next slab. What was found out about samples of the last ones is kept as far as the new slab's
  /// halo. False behind the last one.
  bool advance();
  [[nodiscard]] const SampleTree& tree() const { return *tree_; }
  /// In the order of the tree's places.
  [[nodiscard]] WindowSamples& samples() { return samples_; }
  /// Places of the slab's own samples, ascending.
  [[nodiscard]] const std::vector<std::uint32_t>& core() const { return core_; }
  [[nodiscard]] std::uint64_t done() const { return done_; }  ///< samples of this slab and the ones before

 private:
  void load(std::size_t bucket);
  void keep_what_is_near();

  const SlabStore& store_;
  WindowSettings settings_;
  Slab slab_;
  std::size_t loaded_ = 0;  ///< buckets before it have been read
  std::uint64_t done_ = 0;
  std::deque<WindowSamples> ahead_;  ///< of buckets [slab_.end, loaded_)
  WindowSamples before_;             ///< of earlier slabs
  WindowSamples samples_;
  std::vector<std::uint32_t> core_;
  std::unique_ptr<SampleTree> tree_;
};

// Neighbouring samples grow together to patches of one sign: pieces of the surface within which links agree.

struct PatchSettings {
  std::int32_t cell = 1;    ///< steps: patches lie within cubes of this side, on its multiples
  int neighbours = 16;      ///< samples that lie within Links::scale
  bool given_stay = false;  ///< given normals keep their sign: they belong to the fixed node
};

/// The smallest side a cell can have: their numbers must fit 21 bits.
inline constexpr std::int32_t kLeastPatchCell = 1 << 11;

/// Groups the slab's samples (links.core) into patches, gives them nodes and the signs they have relative to these, and
/// adds the slab to the graph: nodes, edges to the patches of this and earlier slabs, links within. Samples without a
/// normal get no node.
void grow_patches(const SampleTree& tree, const PatchSettings& settings, const Viewpoints& viewpoints,
                  const Links& links, WindowSamples& samples, PatchGraph& graph);

}  // namespace lamina::normals
