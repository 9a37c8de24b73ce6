// A window that slides over the slab store: one slab at a time, with what lies within reach of it.
#pragma once
#include <cstdint>
#include <deque>
#include <memory>

#include "lamina/slab_store.h"
#include "normals/sample_tree.h"
#include "normals/window_samples.h"

namespace lamina::normals {

struct WindowSettings {
  std::int32_t reach = 1;  ///< steps to either side of the slab that the window shows
  std::uint64_t least_samples =
      1;  ///< of a slab, unless the store ends: buckets are taken together until they are enough
  std::int32_t least_height = 1;  ///< steps, likewise
};

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
  void choose_slab();
  void keep_what_is_near();

  const SlabStore& store_;
  WindowSettings settings_;
  std::size_t next_ = 0;             ///< bucket the next slab begins with
  std::size_t loaded_ = 0;           ///< buckets before it have been read
  std::int64_t low_ = 0, high_ = 0;  ///< z of the slab's lowest and highest sample
  std::uint64_t done_ = 0;
  std::deque<WindowSamples> ahead_;  ///< of buckets [next_, loaded_)
  WindowSamples before_;             ///< of earlier slabs
  WindowSamples samples_;
  std::vector<std::uint32_t> core_;
  std::unique_ptr<SampleTree> tree_;
};

}  // namespace lamina::normals
