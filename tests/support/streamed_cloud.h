// The rooms in front of projection over a small cloud: store, feed, window, refined and with its corners placed.
#pragma once
#include <algorithm>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "base/temporary_folder.h"
#include "octree/refine.h"
#include "octree/window.h"
#include "samples/sample_feed.h"

namespace lamina::test {

inline StoreLayout layout_of(const LocalSamples& s) {
  StoreLayout layout{!s.radius.empty(), !s.quality.empty(), {}};
  for (std::size_t a = 0; a < s.attributes.size(); ++a) {
    layout.attributes.push_back({"a" + std::to_string(a), ScalarType::float32});
  }
  return layout;
}

inline SlabStore make_store(const LocalSamples& s, std::int32_t bucket_height) {
  const TemporaryFolder folder;
  const auto [low, high] = std::minmax_element(s.z.begin(), s.z.end());
  StoreSettings settings;
  settings.directory = folder.path();
  settings.z_min = floor_div(*low, bucket_height) * bucket_height;
  settings.bucket_height = bucket_height;
  settings.buckets = static_cast<std::size_t>((*high - settings.z_min) / bucket_height) + 1;
  settings.buffer_bytes = 1u << 20;
  SlabStoreWriter writer(layout_of(s), settings);
  writer.append(s);
  return writer.finish();
}

inline Bounds bounds_of(const LocalSamples& s) {
  const auto x = std::minmax_element(s.x.begin(), s.x.end());
  const auto y = std::minmax_element(s.y.begin(), s.y.end());
  return {*x.first, *x.second, *y.first, *y.second};
}

/// A cloud with given radii on its way to projection, with the normals of a filter where there is one.
class StreamedCloud {
 public:
  StreamedCloud(const LocalSamples& cloud, const Lattice& lattice, const FeedSettings& settings,
                std::int32_t bucket_height, NormalFilter* filter = nullptr)
      : store_(make_store(cloud, bucket_height)),
        feed(store_, lattice, settings, {}, true),
        window(lattice, static_cast<int>(cloud.attributes.size()), bounds_of(cloud)),
        first(lattice.slab_of(*std::min_element(cloud.z.begin(), cloud.z.end())) - 2),
        end(lattice.slab_of(*std::max_element(cloud.z.begin(), cloud.z.end())) + 4) {
    if (filter != nullptr) feed.filter_normals(*filter);
    feed.prepare(std::numeric_limits<std::int32_t>::max(), [&](const Batch& ready) {
      std::vector<Mark> marks;
      for (const auto& b : ready) {
        for (std::size_t i = 0; i < b->samples.size(); ++i) {
          if (b->support[i] > 0)
            marks.push_back({b->samples.x[i], b->samples.y[i], b->samples.z[i], b->level[i], b->support[i]});
        }
      }
      mark_samples(window, marks);
    });
    for (std::int32_t s = first; s < end; ++s) refine_slab(window, s);
    for (std::int32_t s = first; s < end; ++s) place_corners(window, s);
  }

 private:
  SlabStore store_;

 public:
  SampleFeed feed;
  Window window;
  std::int32_t first, end;  ///< slabs that hold anything
};

}  // namespace lamina::test
