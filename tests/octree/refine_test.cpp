#include "octree/refine.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <numeric>
#include <random>

#include "octree/octree_truth.h"
#include "support/window_contents.h"

namespace lamina::test {
namespace {

struct Marked {
  Lattice lattice;
  std::vector<Mark> marks;
  std::int32_t first = 0, end = 0;  ///< slabs the octree can have corners in

  void bound() {
    first = end = 0;
    for (std::size_t i = 0; i < marks.size(); ++i) {
      const std::int32_t s = lattice.slab_of(marks[i].z);
      first = i == 0 ? s - 3 : std::min(first, s - 3);
      end = i == 0 ? s + 5 : std::max(end, s + 5);
    }
  }
  [[nodiscard]] Bounds bounds() const {
    Bounds b{marks[0].x, marks[0].x, marks[0].y, marks[0].y};
    for (const Mark& m : marks) {
      b = {std::min(b.x_min, m.x), std::max(b.x_max, m.x), std::min(b.y_min, m.y), std::max(b.y_max, m.y)};
    }
    return b;
  }
};

/// A sample whose active radius and height end so far from all corners that rounding leaves no doubt.
Mark decided(const Lattice& lattice, Mark m) {
  const std::int32_t a = lattice.cell_size(m.level);
  const Cell home{floor_div(m.x, a), floor_div(m.y, a), floor_div(m.z, a)};
  for (int i = 0; i < 64; ++i) {
    const Cell corner = home + Cell{i % 4 - 1, i / 4 % 4 - 1, i / 16 - 1};
    const double d = OctreeTruth::distance(lattice, m, corner);
    const double h = std::abs(OctreeTruth::height(lattice, m, corner));
    if (std::abs(d - static_cast<double>(m.active_radius)) > 1e-5 * a &&
        std::abs(h - static_cast<double>(m.active_height)) > 1e-5)
      continue;
    m.active_radius *= 1.001F;
    m.active_height *= 1.001F;
    i = -1;
  }
  return m;
}

/// A few clusters of samples, anywhere in or beside the window's table, near and far from cell borders.
Marked random_marks(std::uint64_t seed, int levels) {
  std::mt19937_64 random(seed);
  const auto between = [&](int lo, int hi) { return std::uniform_int_distribution<int>(lo, hi)(random); };
  Marked out{{between(0, 2) == 0 ? 1 : between(2, 90), levels}, {}};
  const int slab = out.lattice.slab_height();
  const int clusters = between(1, 3);
  for (int c = 0; c < clusters; ++c) {
    const std::array<int, 3> at{between(-4, 4) * slab, between(-4, 4) * slab, between(-3, 3) * slab};
    const int width = between(1, 2 * slab);
    const int n = between(1, 8);
    for (int i = 0; i < n; ++i) {
      const auto level = static_cast<std::uint8_t>(between(0, levels - 1));
      const float radius = static_cast<float>(out.lattice.cell_size(level)) * static_cast<float>(between(1, 300)) / 100;
      Mark mark{at[0] + between(-width, width), at[1] + between(-width, width), at[2] + between(-width, width), level,
                radius};
      if (between(0, 1) == 0) {
        mark.normal = {0.48F, between(0, 1) == 0 ? 0.6F : -0.6F, -0.64F};
        mark.active_height = static_cast<float>(between(1, 200)) / 100;
      }
      out.marks.push_back(decided(out.lattice, mark));
    }
  }
  out.bound();
  return out;
}

void refine_all(Window& window, const Marked& m) {
  for (std::int32_t s = m.first; s < m.end; ++s) refine_slab(window, s);
  for (std::int32_t s = m.first; s < m.end; ++s) place_corners(window, s);
}

std::vector<std::uint64_t> refined_bits(const Marked& m) {
  Window window(m.lattice, 0);
  mark_samples(window, m.marks);
  refine_all(window, m);
  return all_bits(window, m.first, m.end);
}

/// Compares set by set; the first difference is named.
testing::AssertionResult same(const char* what, int level, const std::set<Cell>& found, const std::set<Cell>& truth) {
  if (found == truth) return testing::AssertionSuccess();
  std::vector<Cell> odd;
  std::set_symmetric_difference(found.begin(), found.end(), truth.begin(), truth.end(), std::back_inserter(odd));
  const Cell c = odd.front();
  return testing::AssertionFailure() << what << " of level " << level << ": " << found.size() << " for " << truth.size()
                                     << ", " << odd.size() << " differ, the first (" << c.x << ", " << c.y << ", "
                                     << c.z << ") is " << (truth.contains(c) ? "missing" : "too many");
}

void expect_truth(const Window& window, const Marked& m) {
  const OctreeTruth truth(m.lattice, m.marks);
  for (int level = 0; level < m.lattice.levels; ++level) {
    const OctreeTruth::Level& t = truth.levels[static_cast<std::size_t>(level)];
    const auto found = [&](auto mask) { return set_cells(window, level, m.first - 2, m.end + 2, mask); };
    EXPECT_TRUE(same("subdivided cells", level, found(&CornerBlock::split), t.split));
    EXPECT_TRUE(same("leaf cells", level, found(&CornerBlock::cells), t.cells));
    EXPECT_TRUE(same("corners", level, found(&CornerBlock::corners), t.corners));
    EXPECT_TRUE(same("shared corners", level, found(&CornerBlock::shared), t.shared));
    EXPECT_TRUE(same("active corners", level, found(&CornerBlock::active), t.active));
    std::uint64_t cells = 0;
    for (std::int32_t s = m.first; s < m.end; ++s) {
      const std::uint64_t n = count_cells(window, level, s);
      const auto in_slab = std::count_if(t.cells.begin(), t.cells.end(),
                                         [&](const Cell& c) { return m.lattice.slab_of_layer(level, c.z) == s; });
      EXPECT_EQ(n, static_cast<std::uint64_t>(in_slab)) << "level " << level << " slab " << s;
      cells += n;
    }
    EXPECT_EQ(cells, t.cells.size());
  }
}

TEST(Refine, OctreeIsTheOneSamplesAskFor) {
  std::size_t shared = 0;
  EXPECT_TRUE(rc::check("octree", [&] {
    const int levels = *rc::gen::inRange(1, 7);
    const Marked m = random_marks(*rc::gen::arbitrary<std::uint64_t>(), levels);
    // With and without lookup tables.
    Window window(m.lattice, 0, *rc::gen::arbitrary<bool>() ? m.bounds() : Bounds{});
    mark_samples(window, m.marks);
    refine_all(window, m);
    expect_truth(window, m);
    for (int l = 1; l < levels; ++l) shared += set_cells(window, l, m.first, m.end, &CornerBlock::shared).size();
    RC_ASSERT(!testing::Test::HasFailure());
  }));
  EXPECT_GT(shared, 1000U);
}

TEST(Refine, EightLevelsAcrossTheOrigin) {
  Marked m{{3, 8}, {{-1, -1, -1, 0, 4}, {700, -700, 380, 7, 500}, {40, 30, 500, 3, 60}}};
  m.bound();
  Window window(m.lattice, 0, m.bounds());
  mark_samples(window, m.marks);
  refine_all(window, m);
  expect_truth(window, m);
}

TEST(Refine, CornersOfFarCoordinatesAreExact) {
  // Near the ends of the fixed-point range, where a float would be off by many cells.
  Marked m{
      {64, 4},
      {{2'000'000'013, -2'000'000'077, 1'900'000'001, 0, 80}, {2'000'000'613, -2'000'000'377, 1'900'000'801, 2, 400}}};
  m.bound();
  Window window(m.lattice, 0, m.bounds());
  mark_samples(window, m.marks);
  refine_all(window, m);
  expect_truth(window, m);
}

TEST(Refine, OrderOfMarksAndOfPlacingDoesNotMatter) {
  for (std::uint64_t seed = 0; seed < 12; ++seed) {
    const Marked m = random_marks(seed + 1000, 2 + static_cast<int>(seed % 5));
    const std::vector<std::uint64_t> once = refined_bits(m);
    std::mt19937_64 random(seed);
    Marked shuffled = m;
    std::shuffle(shuffled.marks.begin(), shuffled.marks.end(), random);
    shuffled.marks.insert(shuffled.marks.end(), m.marks.begin(), m.marks.end());
    Window window(m.lattice, 0);
    mark_samples(window, shuffled.marks);
    for (std::int32_t s = m.first; s < m.end; ++s) refine_slab(window, s);
    std::vector<std::int32_t> slabs(static_cast<std::size_t>(m.end - m.first));
    std::iota(slabs.begin(), slabs.end(), m.first);
    std::shuffle(slabs.begin(), slabs.end(), random);
    for (const std::int32_t s : slabs) place_corners(window, s);
    // Leaves without content may be there or not: sets are compared, not leaves.
    expect_truth(window, m);
    EXPECT_EQ(refined_bits(shuffled), once) << "seed " << seed;
  }
}

TEST(Refine, MarkingRunsThreeSlabsAhead) {
  // The least that the header asks for: when a slab is refined, samples are marked up to three slabs further.
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const Marked m = random_marks(seed + 2000, 1 + static_cast<int>(seed % 6));
    Window window(m.lattice, 0, m.bounds());
    for (std::int32_t s = m.first; s < m.end; ++s) {
      std::vector<Mark> next;
      for (const Mark& mark : m.marks) {
        const std::int32_t at = m.lattice.slab_of(mark.z);
        if (at == s + 3 || (s == m.first && at < s + 3)) next.push_back(mark);
      }
      mark_samples(window, next);
      refine_slab(window, s);
      place_corners(window, s);
    }
    expect_truth(window, m);
    ASSERT_FALSE(HasFailure()) << "seed " << seed;
  }
}

TEST(Refine, MarkingFromSeveralThreads) {
  Marked m{{16, 5}, {}};
  std::mt19937_64 random(7);
  for (int i = 0; i < 4000; ++i) {
    const auto at = [&] { return static_cast<std::int32_t>(random() % 6000) - 3000; };
    const auto level = static_cast<std::uint8_t>(random() % 5);
    m.marks.push_back({at(), at(), at(), level, 1.5F * static_cast<float>(m.lattice.cell_size(level))});
  }
  m.bound();
  const std::vector<std::uint64_t> alone = refined_bits(m);
  for (const bool table : {false, true}) {
    Window window(m.lattice, 0, table ? m.bounds() : Bounds{});
    for (std::int32_t s = m.first; s < m.end; ++s) window.cover(s);
    const tbb::global_control threads(tbb::global_control::max_allowed_parallelism, 4);
    tbb::parallel_for(std::size_t{0}, m.marks.size(), [&](std::size_t i) { mark_samples(window, {&m.marks[i], 1}); });
    refine_all(window, m);
    EXPECT_EQ(all_bits(window, m.first, m.end), alone) << "table " << table;
  }
}

TEST(Refine, NoSamplesNoCells) {
  Window window({16, 4}, 0);
  refine_slab(window, 0);
  place_corners(window, 0);
  for (int level = 0; level < 4; ++level) {
    EXPECT_EQ(count_cells(window, level, 0), 0U);
    EXPECT_TRUE(window.tiles(level, 0).empty());
  }
}

}  // namespace
}  // namespace lamina::test
