#include "normals/sample_window.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "base/temporary_folder.h"

namespace lamina::normals {
namespace {

/// A store as the job fills it: rows numbered, z anywhere, most buckets full and some empty.
SlabStore numbered_store(const std::string& folder, std::size_t count, std::vector<std::int32_t>& z_of_row) {
  StoreLayout layout;
  layout.attributes = {{"row0", ScalarType::uint16}, {"row1", ScalarType::uint16}, {"row2", ScalarType::uint16}};
  SlabStoreWriter writer(layout, {folder, -1000, 100, 20});
  std::mt19937 random(1);
  std::uniform_int_distribution<std::int32_t> at(-1000, 999);
  LocalSamples samples;
  samples.attributes.resize(3);
  for (std::size_t i = 0; i < count; ++i) {
    std::int32_t z = at(random);
    if (z > 200 && z < 500) z = -z;
    z_of_row.push_back(z);
    samples.x.push_back(at(random));
    samples.y.push_back(at(random));
    samples.z.push_back(z);
    samples.nx.push_back(0);
    samples.ny.push_back(0);
    samples.nz.push_back(1);
    samples.attributes[0].push_back(static_cast<float>(i & 0xFFFFU));
    samples.attributes[1].push_back(static_cast<float>(i >> 16));
    samples.attributes[2].push_back(i % 3 == 0 ? 32768.0F : 0.0F);  // every third has a normal of its own
  }
  writer.append(samples);
  return writer.finish();
}

TEST(SampleWindow, ShowsEverySampleOnceAndWhatLiesInReach) {
  const test::TemporaryFolder folder;
  for (const std::int32_t halo : {1, 40, 150, 5000}) {
    for (const std::uint64_t least : {1, 700, 100000}) {
      std::vector<std::int32_t> z;
      const SlabStore store = numbered_store(folder.path(), 5000, z);
      const WindowSettings settings{halo, least, 150};
      const WindowCounts most = largest_window(store, settings);
      SampleWindow window(store, settings);
      std::vector<int> seen(z.size());
      std::uint64_t done = 0;
      while (window.advance()) {
        WindowSamples& s = window.samples();
        std::int32_t low = 1 << 30;
        std::int32_t high = -low;
        for (const std::uint32_t p : window.core()) {
          ++seen[s.row[p]];
          low = std::min(low, s.z[p]);
          high = std::max(high, s.z[p]);
          EXPECT_EQ(s.node[p], kNoNode);
          s.node[p] = static_cast<std::uint32_t>(s.row[p]);  // what a job finds out
        }
        done += window.core().size();
        EXPECT_EQ(window.done(), done);
        EXPECT_LE(s.size(), most.window);
        EXPECT_LE(window.core().size(), most.slab);
        std::size_t in_halo = 0;
        for (const std::int32_t v : z) in_halo += v >= low - halo && v <= high + halo ? 1 : 0;
        ASSERT_EQ(s.size(), in_halo);
        ASSERT_EQ(window.tree().size(), in_halo);
        for (std::size_t i = 0; i < s.size(); ++i) {
          ASSERT_EQ(s.z[i], z[s.row[i]]);
          ASSERT_EQ(s.given[i] != 0, s.row[i] % 3 == 0);
          ASSERT_EQ(s.has_normal(i), s.row[i] % 3 == 0);
          // Samples of earlier slabs come with what was found out about them, later ones with nothing.
          if (s.z[i] < low) {
            ASSERT_EQ(s.node[i], s.row[i]);
          }
          if (s.z[i] > high) {
            ASSERT_EQ(s.node[i], kNoNode);
          }
        }
      }
      EXPECT_EQ(std::count(seen.begin(), seen.end(), 1), static_cast<std::ptrdiff_t>(z.size()));
    }
  }
}

TEST(SampleWindow, IsDoneAtOnceWithAnEmptyStore) {
  const test::TemporaryFolder folder;
  std::vector<std::int32_t> z;
  const SlabStore store = numbered_store(folder.path(), 0, z);
  SampleWindow window(store, {});
  EXPECT_FALSE(window.advance());
  EXPECT_EQ(largest_window(store, {}).window, 0);
}

}  // namespace
}  // namespace lamina::normals
