#include "isosurface/extract.h"

#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <functional>
#include <numbers>

#include "isosurface/stream.h"

namespace lamina::test {
namespace {

using Position = std::array<std::int32_t, 3>;
constexpr std::int32_t kCell = 64;  // steps per finest cell

std::uint64_t mix(std::uint64_t h) {
  h ^= h >> 33;
  h *= 0xff51afd7ed558ccdULL;
  h ^= h >> 33;
  h *= 0xc4ceb9fe1a85ec53ULL;
  return h ^ (h >> 33);
}
/// A random number in [0, 1) of a position.
double noise(std::uint64_t seed, const Position& p) {
  for (const std::int32_t c : p) seed = mix(seed * 31 + static_cast<std::uint32_t>(c) + 1);
  return static_cast<double>(seed >> 11) * 0x1p-53;
}

/// One random case: an octree without any constraint and a field of one of three kinds, positive on the outside of the
/// box so that the surface is closed.
struct Case {
  Octree octree;
  std::uint64_t seed;
  int kind;           // 0 random signs, 1 smooth, 2 thin sheets
  double unseen = 0;  // share of corners without samples
  double density;
  std::array<double, 3> wave{};

  static Case make(std::uint64_t seed, int levels, std::array<int, 3> size) {
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> uniform(0, 1);
    const auto origin = [&] { return static_cast<int>(random() % 7) - 3; };
    const std::array<int, 3> at{origin(), origin(), origin()};
    Case c{Octree(levels, size, at), seed, static_cast<int>(random() % 3), 0, uniform(random)};
    const double split = 0.1 + 0.6 * uniform(random);
    c.octree.for_cells([&](int l, int x, int y, int z) {
      if (l > 0 && uniform(random) < split) c.octree.subdivide(l, x, y, z);
    });
    for (double& w : c.wave) w = 0.3 + uniform(random);
    return c;
  }
  void drop_cells(double share) {
    octree.for_cells([&](int l, int x, int y, int z) {
      Octree::State& s = octree.at(l, x, y, z);
      if (s == Octree::leaf && noise(seed + 77 + l, {x, y, z}) < share) s = Octree::missing;
    });
  }
  [[nodiscard]] FieldSample field(const Position& p) const {
    const Cell first = octree.first(0);
    const std::array<int, 3> n = octree.cells(0);
    const std::array<std::int32_t, 3> low{first.x, first.y, first.z};
    double phase = 0;
    double sum = 0;
    for (int i = 0; i < 3; ++i) {
      const std::int32_t at = p[i] / kCell - low[i];
      if (at <= 0 || at >= n[i]) return {1.0F};
      phase += wave[i] * at;
      sum += std::sin(2 * wave[i] * at + 1);
    }
    const double magnitude = 0.02 + noise(seed + 1, p);
    bool negative = false;
    if (kind == 0) negative = noise(seed, p) < density;
    if (kind == 1) negative = sum + 2 * density - 1 < 0;
    if (kind == 2) negative = std::abs(std::sin(phase)) < 0.4;
    FieldSample s;
    s.distance = static_cast<float>((negative ? -kCell : kCell) * magnitude);
    s.seen = noise(seed + 2, p) >= unseen;
    s.defined = noise(seed + 3, p) < 0.6;
    return s;
  }
  [[nodiscard]] WholeMesh mesh(const std::function<void(IsoSlab&)>& prepare = {}) {
    Window window(Lattice{kCell, octree.levels()}, 0);
    octree.fill(window, [this](const Position& p) { return field(p); });
    return extract_all(window, octree.first_slab(), octree.end_slab(), prepare);
  }
};

/// What a run of cases has seen, so that none of them tests nothing.
struct Coverage {
  std::uint64_t triangles = 0, general = 0, centres = 0, rejected = 0, separated = 0;
  std::size_t boundary = 0;
  void add(const WholeMesh& mesh, const MeshFacts& facts) {
    triangles += mesh.triangles.size();
    general += mesh.counts.general_cells;
    rejected += mesh.counts.rejected_loops;
    separated += mesh.counts.separated_vertices;
    boundary += facts.boundary.size();
    for (const IsoVertex& v : mesh.vertices) centres += v.axis == IsoVertex::kCentre ? 1 : 0;
  }
};

void expect_closed(Case& c, Coverage& coverage) {
  const WholeMesh mesh = c.mesh();
  const MeshFacts facts = check_mesh(mesh.triangles);
  coverage.add(mesh, facts);
  ASSERT_TRUE(facts.is_closed_manifold())
      << "seed " << c.seed << " kind " << c.kind << " levels " << c.octree.levels() << ": degenerate "
      << facts.degenerate << " duplicates " << facts.duplicates << " complex " << facts.complex_edges << " fans "
      << facts.several_fans << " boundary " << facts.boundary.size();
  for (const long chi : facts.euler) ASSERT_EQ(chi % 2, 0) << "seed " << c.seed;
  ASSERT_EQ(mesh.counts.rejected_loops, 0U);
  ASSERT_EQ(mesh.counts.separated_vertices, 0U);
  for (const auto& t : mesh.triangles) {
    for (const std::uint32_t v : t) ASSERT_EQ(mesh.vertices[v].open, 0) << "seed " << c.seed;
  }
}

void expect_manifold(Case& c, Coverage& coverage) {
  const WholeMesh mesh = c.mesh();
  const MeshFacts facts = check_mesh(mesh.triangles);
  coverage.add(mesh, facts);
  ASSERT_TRUE(facts.is_manifold()) << "seed " << c.seed << " kind " << c.kind << " levels " << c.octree.levels()
                                   << ": degenerate " << facts.degenerate << " duplicates " << facts.duplicates
                                   << " complex " << facts.complex_edges << " fans " << facts.several_fans;
  for (const auto& edge : facts.boundary) {
    for (const std::uint32_t v : edge) ASSERT_NE(mesh.vertices[v].open, 0) << "seed " << c.seed;
  }
}

TEST(Extract, ClosedOnRandomOctreesOfFourLevels) {
  Coverage coverage;
  for (std::uint64_t seed = 0; seed < 8000; ++seed) {
    Case c = Case::make(seed, 1 + static_cast<int>(seed % 4),
                        {1 + static_cast<int>(seed % 2), 1, 1 + static_cast<int>(seed % 3)});
    expect_closed(c, coverage);
    if (HasFatalFailure()) return;
  }
  EXPECT_GT(coverage.triangles, 1000000U);
  EXPECT_GT(coverage.general, 50000U);
  EXPECT_GT(coverage.centres, 1000U);
}

TEST(Extract, ClosedOnRandomOctreesOfSixLevels) {
  Coverage coverage;
  for (std::uint64_t seed = 0; seed < 500; ++seed) {
    Case c = Case::make(seed + 100000, 5 + static_cast<int>(seed % 2), {1, 1, 1 + static_cast<int>(seed % 2)});
    expect_closed(c, coverage);
    if (HasFatalFailure()) return;
  }
  EXPECT_GT(coverage.triangles, 1000000U);
  EXPECT_GT(coverage.general, 50000U);
  EXPECT_GT(coverage.centres, 1000U);
}

TEST(Extract, ManifoldWithBoundaryWhereCornersAreUnseenOrCellsMissing) {
  Coverage coverage;
  for (std::uint64_t seed = 0; seed < 4000; ++seed) {
    Case c = Case::make(seed + 200000, 1 + static_cast<int>(seed % 4),
                        {1 + static_cast<int>(seed % 2), 2, 1 + static_cast<int>(seed % 3)});
    if (seed % 3 != 0) c.unseen = 0.2 + 0.15 * static_cast<double>(seed % 5);
    if (seed % 3 != 1) c.drop_cells(0.05 + 0.1 * static_cast<double>(seed % 4));
    expect_manifold(c, coverage);
    if (HasFatalFailure()) return;
  }
  EXPECT_GT(coverage.rejected, 100000U);
  EXPECT_GT(coverage.separated, 1000U);
  EXPECT_GT(coverage.boundary, 100000U);
}

TEST(Extract, SurfaceDoesNotDependOnSlabHeight) {
  for (std::uint64_t seed = 0; seed < 150; ++seed) {
    Case c = Case::make(seed + 300000, 2 + static_cast<int>(seed % 2), {4, 4, 4});
    c.octree = Octree(c.octree.levels(), {4, 4, 4}, {-4, 4, static_cast<int>(seed % 3) * 4 - 8});
    std::mt19937_64 random(seed);
    c.octree.for_cells([&](int l, int x, int y, int z) {
      if (l > 0 && random() % 4 == 0) c.octree.subdivide(l, x, y, z);
    });
    if (seed % 2 == 1) {
      c.unseen = 0.4;
      c.drop_cells(0.1);
    }
    const WholeMesh mesh = c.mesh();
    for (int more = 1; more <= 2; ++more) {
      Case taller = c;
      taller.octree = c.octree.under(more);
      const WholeMesh other = taller.mesh();
      ASSERT_EQ(mesh.named(), other.named()) << "seed " << seed << " more " << more;
      ASSERT_EQ(mesh.counts.crossing_cells, other.counts.crossing_cells);
      ASSERT_EQ(mesh.counts.general_cells, other.counts.general_cells);
      ASSERT_EQ(mesh.counts.separated_vertices, other.counts.separated_vertices);
    }
  }
}

TEST(Extract, SameBytesForAnyNumberOfThreads) {
  Case c = Case::make(5, 5, {4, 4, 2});
  c.kind = 1;
  c.unseen = 0.1;
  WholeMesh one;
  tbb::task_arena(1).execute([&] { one = c.mesh(); });
  for (const int threads : {2, 4}) {
    WholeMesh many;
    tbb::task_arena(threads).execute([&] { many = c.mesh(); });
    EXPECT_EQ(one.triangles, many.triangles);
    EXPECT_EQ(one.positions, many.positions);
  }
}

/// A signed distance field on an octree that is refined at random, or not at all.
WholeMesh mesh_of(const std::function<double(const std::array<double, 3>&)>& distance, bool mixed) {
  Octree octree(4, {6, 6, 6}, {-3, -3, -3});
  std::mt19937_64 random(1);
  octree.for_cells([&](int l, int x, int y, int z) {
    if (l > 0 && (mixed ? random() % 3 == 0 || l == 3 : l > 1)) octree.subdivide(l, x, y, z);
  });
  Window window(Lattice{kCell, 4}, 0);
  octree.fill(window, [&](const Position& p) {
    const std::array<double, 3> at{static_cast<double>(p[0]) / kCell, static_cast<double>(p[1]) / kCell,
                                   static_cast<double>(p[2]) / kCell};
    FieldSample s;
    s.distance = static_cast<float>(distance(at) * kCell);
    return s;
  });
  return extract_all(window, octree.first_slab(), octree.end_slab());
}

double signed_volume(const WholeMesh& mesh) {
  double volume = 0;
  for (const auto& t : mesh.triangles) {
    const auto& a = mesh.positions[t[0]];
    const auto& b = mesh.positions[t[1]];
    const auto& c = mesh.positions[t[2]];
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3;
      const int k = (i + 2) % 3;
      volume += static_cast<double>(a[i]) * (static_cast<double>(b[j]) * c[k] - static_cast<double>(b[k]) * c[j]) / 6;
    }
  }
  return volume / (static_cast<double>(kCell) * kCell * kCell);
}

TEST(Extract, NothingStaysOfWhatASlabHeldBefore) {
  Case c = Case::make(5, 3, {4, 4, 2});
  c.kind = 1;
  c.unseen = 0.2;
  const WholeMesh fresh = c.mesh();
  const WholeMesh used = c.mesh([](IsoSlab& slab) {
    slab.slab = 99;
    slab.corners.assign(3000, {{1, 2, 3}, {1, 1, 1}, {1, 1, 1}, 1, 1, 1, true});
    slab.corner_attributes.assign(2, std::vector<float>(7000, 5.0F));
    slab.vertices.assign(3000, {{77}, {88}, 0.9F, 2, 7, true, 15});
    slab.triangles.assign(5000, {SlabIndex{1}, SlabIndex{2}, SlabIndex{3}});
  });
  EXPECT_EQ(fresh.triangles, used.triangles);
  EXPECT_EQ(fresh.named(), used.named());
  ASSERT_EQ(fresh.slabs.size(), used.slabs.size());
  for (std::size_t i = 0; i < fresh.slabs.size(); ++i) {
    const IsoSlab &a = fresh.slabs[i], &b = used.slabs[i];
    EXPECT_EQ(a.slab, b.slab);
    EXPECT_EQ(a.corner_attributes, b.corner_attributes);
    ASSERT_EQ(a.corners.size(), b.corners.size());
    for (std::size_t k = 0; k < a.corners.size(); ++k) {
      EXPECT_EQ(std::tie(a.corners[k].position, a.corners[k].offset, a.corners[k].normal, a.corners[k].distance,
                         a.corners[k].curvature, a.corners[k].cell, a.corners[k].trusted),
                std::tie(b.corners[k].position, b.corners[k].offset, b.corners[k].normal, b.corners[k].distance,
                         b.corners[k].curvature, b.corners[k].cell, b.corners[k].trusted));
    }
  }
}

TEST(Extract, SphereIsASphere) {
  const double radius = 17.3;
  const auto sphere = [&](const std::array<double, 3>& p) { return std::hypot(p[0], p[1], p[2]) - radius; };
  for (const bool mixed : {false, true}) {
    const WholeMesh mesh = mesh_of(sphere, mixed);
    const MeshFacts facts = check_mesh(mesh.triangles);
    EXPECT_TRUE(facts.is_closed_manifold());
    EXPECT_EQ(facts.euler, std::vector<long>{2});
    EXPECT_NEAR(signed_volume(mesh), 4.0 / 3 * std::numbers::pi * std::pow(radius, 3), 900);
    for (const auto& t : mesh.triangles) {
      for (const std::uint32_t v : t) {
        const auto& p = mesh.positions[v];
        EXPECT_NEAR(std::hypot(p[0], p[1], p[2]) / kCell, radius, 0.15);
      }
    }
    EXPECT_EQ(mesh.counts.general_cells > 0, mixed);
  }
}

TEST(Extract, TorusIsATorus) {
  const auto torus = [](const std::array<double, 3>& p) {
    return std::hypot(std::hypot(p[0] - 0.2, p[1]) - 14.1, p[2] - 0.3) - 6.2;
  };
  for (const bool mixed : {false, true}) {
    const MeshFacts facts = check_mesh(mesh_of(torus, mixed).triangles);
    EXPECT_TRUE(facts.is_closed_manifold());
    EXPECT_EQ(facts.euler, std::vector<long>{0});
  }
}

}  // namespace
}  // namespace lamina::test
