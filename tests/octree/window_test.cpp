#include "octree/window.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>

#include <map>
#include <random>
#include <set>
#include <tuple>

namespace lamina {
namespace {

/// (z, y, x): the order stages see leaves in.
using Key = std::tuple<std::int32_t, std::int32_t, std::int32_t>;
Key key_of(const Block& b) {
  return {b.z, b.y, b.x};
}

/// What a window should hold: leaves by level and place.
struct Model {
  explicit Model(const Lattice& l) : lattice(l), leaves(static_cast<std::size_t>(l.levels)) {}
  [[nodiscard]] std::int32_t last_slab(int level, std::int32_t block_z) const {
    return lattice.slab_of_layer(level, block_z * 8 + 7);
  }
  [[nodiscard]] std::int32_t first_slab(int level, std::int32_t block_z) const {
    return lattice.slab_of_layer(level, block_z * 8);
  }
  Lattice lattice;
  std::vector<std::map<Key, CornerBlock*>> leaves;
};

void expect_model(const Window& window, const Model& model, std::int32_t first, std::int32_t end) {
  std::size_t n = 0;
  for (int level = 0; level < window.levels(); ++level) {
    const auto& leaves = model.leaves[static_cast<std::size_t>(level)];
    n += leaves.size();
    for (const auto& [key, block] : leaves) {
      const auto& [z, y, x] = key;
      RC_ASSERT(window.probe(level, {x, y, z}) == block);
      RC_ASSERT(block->cells.test(3));  // its content is its own
      for (int dz = -1; dz <= 1; ++dz) {
        for (int dy = -1; dy <= 1; ++dy) {
          for (int dx = -1; dx <= 1; ++dx) {
            const auto at = leaves.find({z + dz, y + dy, x + dx});
            RC_ASSERT(block->around[CornerBlock::towards(dx, dy, dz)] == (at == leaves.end() ? nullptr : at->second));
          }
        }
      }
    }
    for (std::int32_t s = first; s < end; ++s) {
      std::vector<Key> expected;
      for (const auto& [key, block] : leaves) {
        const std::int32_t z = std::get<0>(key);
        if (model.first_slab(level, z) <= s && s <= model.last_slab(level, z)) expected.push_back(key);
      }
      std::vector<Key> found;
      for (const Tile& t : window.tiles(level, s)) {
        found.push_back(key_of(t.block));
        RC_ASSERT(leaves.at(found.back()) == t.leaf);
      }
      RC_ASSERT(found == expected);
    }
  }
  RC_ASSERT(window.leaf_count() == n);
}

TEST(Window, LeavesComeAndGoLikeAModel) {
  EXPECT_TRUE(rc::check("model", [] {
    const Lattice lattice{*rc::gen::inRange(1, 100), *rc::gen::inRange(1, 7)};
    std::mt19937_64 random(*rc::gen::arbitrary<std::uint64_t>());
    const auto between = [&](int lo, int hi) { return std::uniform_int_distribution<int>(lo, hi)(random); };
    const std::int32_t width = lattice.slab_height() * 4;
    // Leaves lie in the table, beside it, or there is none.
    const Bounds bounds = between(0, 2) == 0 ? Bounds{} : Bounds{-width, width, -width / 2, width};
    Window window(lattice, 2, bounds);
    Model model(lattice);
    std::int32_t floor = -20;
    for (int round = 0; round < 6; ++round) {
      for (int i = 0; i < 30; ++i) {
        const int level = between(0, lattice.levels - 1);
        const std::int32_t slab = between(floor, 10);
        const Block b{between(-6, 6), between(-6, 6), lattice.first_layer(level, slab) >> 3};
        if (model.last_slab(level, b.z) < floor) continue;
        if (i % 3 == 0) window.cover(slab);
        CornerBlock& block = i % 2 == 0 ? window.touch(level, b) : window.touch_shared(level, b);
        const auto [at, made] = model.leaves[static_cast<std::size_t>(level)].try_emplace(key_of(b), &block);
        RC_ASSERT(at->second == &block);
        RC_ASSERT(made != block.cells.test(3));
        block.cells.set(3);
        const Block beside{b.x + between(-2, 2), b.y + between(-2, 2), b.z + between(-1, 1)};
        const auto& leaves = model.leaves[static_cast<std::size_t>(level)];
        const auto found = leaves.find(key_of(beside));
        RC_ASSERT(window.probe(level, beside) == (found == leaves.end() ? nullptr : found->second));
      }
      window.introduce();
      expect_model(window, model, -22, 12);
      if (between(0, 1) == 0) continue;
      floor = between(floor, 8);
      window.retire_below(floor);
      for (int level = 0; level < lattice.levels; ++level) {
        std::erase_if(model.leaves[static_cast<std::size_t>(level)],
                      [&](const auto& leaf) { return model.last_slab(level, std::get<0>(leaf.first)) < floor; });
      }
      expect_model(window, model, -22, 12);
    }
  }));
}

TEST(Window, NothingIsLeftBehindTheSweep) {
  const Lattice lattice{10, 4};
  Window window(lattice, 0, {0, 400, 0, 400});
  const std::size_t empty = window.memory();
  for (std::int32_t slab = -9; slab < 30; ++slab) {
    for (int level = 0; level < 4; ++level) {
      for (std::int32_t x = -3; x < 3; ++x) window.touch(level, {x, 1, lattice.first_layer(level, slab) >> 3});
    }
    window.retire_below(slab - 1);
    // Leaves of this slab and of the one below: coarse ones are shared with slabs around.
    EXPECT_LE(window.leaf_count(), 6U * 4 * 2);
    EXPECT_GE(window.leaf_count(), 6U * 4);
    EXPECT_EQ(window.tiles(0, slab - 2).size(), 0U);
  }
  window.retire_below(10'000);
  EXPECT_EQ(window.leaf_count(), 0U);
  EXPECT_EQ(window.memory(), empty);
}

TEST(Window, WideLayersTakeMemoryForTheirLeavesOnly) {
  // A station's scan: thousands of the finest blocks wide, a hundred layers within reach of its widest supports.
  const Lattice lattice{8, 1};
  constexpr std::int32_t kHalf = 1'000;  // blocks
  Window window(lattice, 0, {-kHalf * 64, kHalf * 64, -kHalf * 64, kHalf * 64});
  const auto place = [](std::int32_t z, std::int32_t i) { return Block{i * 37 % 900, -i * 11 % 900, z}; };
  constexpr std::int32_t kLayers = 100, kLeaves = 40;
  for (std::int32_t z = 0; z < kLayers; ++z) {
    window.cover(z * 8);
    for (std::int32_t i = 0; i < kLeaves; ++i) window.touch(0, place(z, i));
  }
  for (std::int32_t z = 0; z < kLayers; ++z) {
    for (std::int32_t i = 0; i < kLeaves; ++i) ASSERT_NE(window.probe(0, place(z, i)), nullptr);
    EXPECT_EQ(window.probe(0, {kHalf - 1, kHalf - 1, z}), nullptr);
  }
  // A place for each block of the layers would take 3.2 GB.
  EXPECT_LE(window.memory(), 64U << 20);
  window.retire_below(10'000);
  EXPECT_EQ(window.memory(), Window(lattice, 0).memory());
}

TEST(Window, LeavesUsedAgainAreEmpty) {
  const Lattice lattice{10, 1};
  Window window(lattice, 1, {0, 400, 0, 400});
  for (std::int32_t z = 0; z < 4; ++z) {
    for (std::int32_t x = 0; x < 5; ++x) {
      CornerBlock& block = window.touch(0, {x, 0, z});
      EXPECT_FALSE(block.home.any() || block.surface.any() || block.active.any());
      EXPECT_EQ(block.busy_layers | block.doubtful_layers | block.surface_layers, 0);
      EXPECT_TRUE(block.values[0].all().empty());
      EXPECT_EQ(block.values[0].count, 0U);
      EXPECT_EQ(block.centres, nullptr);
      for (BlockMask* m : {&block.home, &block.surface, &block.active}) m->set(x);
      block.busy_layers = block.doubtful_layers = block.surface_layers = 1;
      block.values[0].allocate(7, window.channels());
      block.centres = std::make_shared<Projected>();
    }
    window.retire_below(z * 8);  // the layer before
  }
  EXPECT_EQ(window.leaf_count(), 5U);
}

TEST(Window, SlantedSheetsLeaveNothingBehindEither) {
  // Leaves move sideways with the sweep, so that most inner nodes have none in their last layer; early on they pass
  // through the table.
  for (const std::int32_t slope : {-16, 0, 3, 16}) {
    Window window({10, 4}, 0, {0, 400, 0, 400});
    std::size_t early = 0;
    std::size_t late = 0;
    for (std::int32_t slab = -400; slab < 1200; ++slab) {
      for (std::int32_t x = 0; x < 4; ++x) window.touch(0, {slab * slope + x, 0, slab});
      window.retire_below(slab - 2);
      std::size_t& most = slab < 400 ? early : late;
      most = std::max(most, window.memory());
    }
    EXPECT_LE(late, early) << "slope " << slope;
    // At most the inner nodes of the last 64 and 1024 layers of cells.
    EXPECT_LE(late, 800'000U) << "slope " << slope;
  }
}

TEST(Window, ThreadsTouchTheSameLeaves) {
  const tbb::global_control threads(tbb::global_control::max_allowed_parallelism, 4);
  const Lattice lattice{8, 3};
  for (const bool table : {true, false}) {
    Window window(lattice, 0, table ? Bounds{-500, 500, -500, 500} : Bounds{});
    for (std::int32_t slab = -8; slab < 8; ++slab) window.cover(slab);
    std::vector<CornerBlock*> first(40'000);
    const auto place = [](std::size_t i) {
      const std::uint64_t h = (i % 3000) * 0x9E3779B97F4A7C15ULL;
      return std::pair{static_cast<int>(h % 3), Block{static_cast<std::int32_t>((h >> 8) % 13) - 6,
                                                      static_cast<std::int32_t>((h >> 16) % 13) - 6,
                                                      static_cast<std::int32_t>((h >> 24) % 4) - 2}};
    };
    tbb::parallel_for(std::size_t{0}, first.size(), [&](std::size_t i) {
      const auto [level, block] = place(i);
      first[i] = &window.touch_shared(level, block);
    });
    std::map<std::tuple<int, Key>, CornerBlock*> leaves;
    for (std::size_t i = 0; i < first.size(); ++i) {
      const auto [level, block] = place(i);
      const auto at = leaves.try_emplace({level, key_of(block)}, first[i]).first;
      ASSERT_EQ(at->second, first[i]);
      ASSERT_EQ(window.probe(level, block), first[i]);
    }
    EXPECT_EQ(window.leaf_count(), leaves.size());
    window.introduce();
    for (const auto& [at, block] : leaves) {
      const auto& [level, key] = at;
      for (int i = 0; i < 27; ++i) {
        const auto& [z, y, x] = key;
        const auto beside = leaves.find({level, {z + i / 9 - 1, y + i / 3 % 3 - 1, x + i % 3 - 1}});
        ASSERT_EQ(block->around[static_cast<std::size_t>(i)], beside == leaves.end() ? nullptr : beside->second);
      }
    }
  }
}

TEST(Window, ValueIndexCountsNearCornersOfTheSlab) {
  std::mt19937_64 random(4);
  for (const int layers : {1, 2, 4, 8}) {
    for (int round = 0; round < 10; ++round) {
      Projected points;
      for (std::uint64_t& w : points.active.words) w = random() & random();
      std::map<int, std::uint32_t> count;  // by slab inside the leaf
      for (int offset = 0; offset < 512; ++offset) {
        if (!points.active.test(offset)) continue;
        ASSERT_EQ(points.value_index(offset, layers), count[(offset >> 6) / layers]++) << "layers " << layers;
      }
    }
  }
}

TEST(Window, RetiringValuesKeepsMasksAndOtherSlabs) {
  const Lattice lattice{10, 3};  // 4, 2 and 1 layers per slab: a leaf holds several slabs
  Window window(lattice, 1);
  const std::size_t empty = window.memory();
  for (int level = 0; level < 3; ++level) {
    CornerBlock& leaf = window.touch(level, {0, 0, 0});
    leaf.centres = std::make_shared<Projected>();
    for (Projected* points : {static_cast<Projected*>(&leaf), leaf.centres.get()}) {
      for (std::uint64_t& w : points->active.words) w = 0xFF;
      for (int place = 0; place < 8 / window.slab_layers(level); ++place) {
        points->values[place].allocate(8 * static_cast<std::uint32_t>(window.slab_layers(level)), window.channels());
      }
    }
  }
  const std::size_t full = window.memory();
  window.retire_values(1);
  // Both kinds of points lose the values of 4 + 2 + 1 layers of eight points.
  EXPECT_EQ(full - window.memory(), sizeof(float) * 2U * 7 * 8 * static_cast<std::size_t>(window.channels()));
  for (int level = 0; level < 3; ++level) {
    const CornerBlock& leaf = *window.probe(level, {0, 0, 0});
    for (const Projected* points :
         {static_cast<const Projected*>(&leaf), static_cast<const Projected*>(leaf.centres.get())}) {
      for (int place = 0; place < 8 / window.slab_layers(level); ++place) {
        EXPECT_EQ(points->values[place].count == 0, place == 1) << "level " << level;
      }
      EXPECT_EQ(points->active.count(), 64);
    }
  }
  window.retire_below(10'000);
  EXPECT_EQ(window.memory(), empty);
}

TEST(BlockMask, BitsByPlace) {
  BlockMask m;
  EXPECT_FALSE(m.any());
  std::set<int> on;
  std::mt19937 random(5);
  for (int i = 0; i < 300; ++i) {
    const int x = static_cast<int>(random() % 8);
    const int y = static_cast<int>(random() % 8);
    const int z = static_cast<int>(random() % 8);
    const int offset = BlockMask::offset(x, y, z);
    EXPECT_EQ(offset, offset_in_block({x - 16, y + 24, z - 8}));
    EXPECT_EQ(m.words[z] >> (x + 8 * y) & 1U, on.count(offset));
    if (random() % 3 == 0) {
      m.reset(offset);
      on.erase(offset);
    } else {
      m.assign(offset, true);
      on.insert(offset);
    }
    EXPECT_EQ(m.count(), static_cast<int>(on.size()));
  }
  for (int offset = 0; offset < 512; ++offset) {
    EXPECT_EQ(m.test(offset), on.count(offset) == 1);
    m.assign(offset, false);
  }
  EXPECT_FALSE(m.any());
}

TEST(Block, NegativeCellsBelongToTheBlockBelow) {
  EXPECT_EQ(block_of({-1, -8, -9}), (Block{-1, -1, -2}));
  EXPECT_EQ(block_of({0, 7, 8}), (Block{0, 0, 1}));
}

}  // namespace
}  // namespace lamina
