// An 8^3 block of cells and of the corners at their lower ends: what a leaf of the window's trees holds. Masks tell
// what exists, one array per slab holds the values of the corners that have any.
#pragma once
#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>

#include "lattice/block_mask.h"

namespace lamina {

/// What a defined corner holds after projection, in channels (lengths in fixed-point steps).
/// Distance is signed (positive outside), the normal is the fit's at the projected point, which lies at corner -
/// distance * normal; curvature is the fit's signed curvature there (1/steps, positive where the surface bends away
/// from its normal, as a sphere seen from outside); offset from the mean is |projected point - weighted average| in
/// units of the local support radius. Of a corner that is not trusted the projected point is that average itself (its
/// offset is the fit's). Where a sharp edge passes the corner the crease channels, two, hold the place and the normal
/// of its vertex (mls/sheets.h), else zero. Density is that of the samples along the surface, 1/steps^2. Channels from
/// kLean to kCreaseEnd are rare: where no stage wants any of them records go without (Window::place_of()).
enum Channel : int {
  kDistance = 0,
  kNormalX,
  kNormalY,
  kNormalZ,
  kCurvature,
  kOffsetFromMean,
  kLean,
  kDensity,
  kCrease,
  kCreaseEnd,
  kFirstAttribute
};

/// Values of the `active` corners of one slab's layers inside a leaf: a record of channels per corner, in mask order.
/// Stages ask for all of a corner, so that records touch fewer lines of the cache than an array per channel would.
/// A block holds eight of them, most of them empty: no larger than need be.
struct CornerValues {
  std::unique_ptr<float[]> data;
  std::uint32_t count = 0;  ///< corners
  std::uint32_t channels = 0;

  CornerValues() = default;
  CornerValues(const CornerValues& other) {
    allocate(other.count, static_cast<int>(other.channels));
    std::copy_n(other.data.get(), size(), data.get());
  }
  CornerValues(CornerValues&& other) noexcept { swap(other); }
  CornerValues& operator=(CornerValues other) noexcept {
    swap(other);
    return *this;
  }
  ~CornerValues() = default;
  void swap(CornerValues& other) noexcept {
    std::swap(data, other.data);
    std::swap(count, other.count);
    std::swap(channels, other.channels);
  }

  /// One channel of all corners.
  template <typename T>
  struct Strided {
    T* first;
    std::uint32_t stride;
    T& operator[](std::size_t i) const { return first[i * stride]; }
  };

  /// Room for values yet to be written.
  void allocate(std::uint32_t corners, int channel_count) {
    count = corners;
    channels = static_cast<std::uint32_t>(channel_count);
    data = size() == 0 ? nullptr : std::make_unique_for_overwrite<float[]>(size());
  }
  /// Of all corners together.
  [[nodiscard]] std::size_t size() const { return std::size_t{count} * channels; }
  // NOLINTBEGIN(readability-make-member-function-const): a constant one's values do not change
  [[nodiscard]] std::span<float> all() { return {data.get(), size()}; }
  [[nodiscard]] float* of(std::uint32_t corner) { return data.get() + std::size_t{corner} * channels; }
  [[nodiscard]] Strided<float> channel(int c) { return {data.get() + c, channels}; }
  // NOLINTEND(readability-make-member-function-const)
  [[nodiscard]] std::span<const float> all() const { return {data.get(), size()}; }
  [[nodiscard]] const float* of(std::uint32_t corner) const { return data.get() + std::size_t{corner} * channels; }
  [[nodiscard]] Strided<const float> channel(int c) const { return {data.get() + c, channels}; }
};

/// Numbers of the isovertices and surface corners of one layer, written by extraction. Tables are per slab
/// (IsoSlab::vertices, IsoSlab::corners); the number of an accepted edge is its layer's base plus its rank in the
/// layer's word of axis x, then y, then z; that of a corner is the base plus its rank in `surface`.
struct LayerNumbers {
  std::uint32_t vertex_base = 0;
  std::uint32_t corner_base = 0;
};

/// Points of a block that are projected, and what came of it.
struct Projected {
  BlockMask active;   ///< worth projecting, close enough to samples; once projected: carry values (CornerValues)
  BlockMask seen;     ///< subset of active: samples contributed; an edge with such an end is valid
  BlockMask trusted;  ///< subset of seen: own value is trusted; other corners are extended from trusted neighbours
  std::array<CornerValues, 8> values;  ///< by slab inside the leaf, Window::slab_in_leaf()

  /// Index of a corner in its slab's CornerValues (`slab_layers` = layers of a slab inside a leaf, a power of two <=
  /// 8). Meaningful only where active.test(offset).
  [[nodiscard]] std::uint32_t value_index(int offset, int slab_layers) const {
    const int z = offset >> 6;
    std::uint32_t n = 0;
    for (int w = z & ~(slab_layers - 1); w < z; ++w) n += static_cast<std::uint32_t>(std::popcount(active.words[w]));
    return n + static_cast<std::uint32_t>(std::popcount(active.words[z] & ((std::uint64_t{1} << (offset & 63)) - 1)));
  }
};

struct CornerBlock : Projected {
  /// The blocks around this one in its level, itself in the middle, null where there is none; kept by the window.
  std::array<CornerBlock*, 27> around{};
  static constexpr int towards(int dx, int dy, int dz) { return 13 + dx + 3 * dy + 9 * dz; }

  // Layers in which extraction has something to look at, bit z for layer z: most leaves lie off the surface.
  std::uint8_t busy_layers = 0;      ///< `busy` is not empty
  std::uint8_t doubtful_layers = 0;  ///< an edge is in `crossing` and not in `accepted`
  std::uint8_t surface_layers = 0;   ///< `surface` may hold corners: an accepted edge begins or ends there
  bool inherits = false;             ///< `above` is not empty

  // Cells of the octree. A cell of this level exists when its parent is split (or at the coarsest level when touched).
  BlockMask home;     ///< cells that hold a sample of this level
  BlockMask touched;  ///< cells that a sample of this level reaches: within three cells of its home
  BlockMask close;    ///< where cells are split: within one cell of the home of a sample of this or a coarser level
  BlockMask above;    ///< cells within one cell of the home of a sample of a coarser level
  BlockMask reached;  ///< cells that a sample of this or a coarser level reaches
  BlockMask split;    ///< subdivided cells
  BlockMask cells;    ///< leaf cells that take part: existing, not split, reached by a sample

  // Corners.
  BlockMask acted_on;  ///< corners up to two cells from a sample of this level, and not beyond its support
  BlockMask corners;   ///< of the leaf cells in `cells`, of this level
  BlockMask shared;    ///< subset of corners: held by a finer level too, whose value counts
  BlockMask outside;   ///< sign (outside): once projected, of the seen corners' own distances; once extended, of all
  // Set when the slab is extended.
  BlockMask defined;  ///< subset of corners: the sign rests on samples, its own or its neighbours'; others are a guess
  BlockMask supported;  ///< corners with samples of their own, or with trusted neighbours on all sides

  // Minimal edges with a sign change, by axis, keyed by their lower corner; written by extraction.
  std::array<BlockMask, 3> crossing;
  std::array<BlockMask, 3> accepted;  ///< subset of crossing: the isovertex is valid
  BlockMask busy;     ///< cells with an accepted edge of this or a finer level at or above their low corner
  BlockMask surface;  ///< corners at an end of an accepted edge
  BlockMask creased;  ///< corners whose vertex lies on a sharp edge; written by projection
  std::array<LayerNumbers, 8> numbers{};

  /// Cell centres, where diffusion projects those instead of the corners; shared so that a block can be copied.
  std::shared_ptr<Projected> centres;
};

// Blocks lie anywhere in memory, and a stage that goes from one to the next would wait for its first look at each.

/// Asks for an object that is looked at soon. Always inlined, as all here: the compiler takes a function that does
/// nothing else for one without effect.
template <typename T>
[[gnu::always_inline]] inline void ask_for(const T& object) {
  constexpr std::size_t kLine = 64;  // bytes
  const char* const bytes = reinterpret_cast<const char*>(&object);
  for (std::size_t at = 0; at < sizeof(object); at += kLine) __builtin_prefetch(bytes + at);
}

/// The parts of a block that a stage looks at.
template <auto... kMembers>
struct BlockParts {
  [[gnu::always_inline]] static inline void ask_for(const CornerBlock& block) {
    (lamina::ask_for(block.*kMembers), ...);
  }
};

/// Stages ask for the block of the tile that comes so many later: far enough ahead to be there in time, near enough not
/// to be lost again.
inline constexpr std::size_t kAskedAhead = 16;

}  // namespace lamina
