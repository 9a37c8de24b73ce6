// A window that slides over the slab store: one slab at a time, with what lies within reach of it.
#pragma once
#include <cstdint>
#include <deque>
#include <memory>

#include "normals/sample_tree.h"
#include "normals/window_samples.h"
#include "store/slab_store.h"

namespace lamina::normals {

struct WindowSettings {
  std::int32_t reach = 1;  ///< steps to either side of the slab that the window shows
  std::uint64_t least_samples =
      1;  ///< of a slab, unless the store ends: buckets are taken together until they are enough
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
  /// reach. False behind the last one.
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

}  // namespace lamina::normals
