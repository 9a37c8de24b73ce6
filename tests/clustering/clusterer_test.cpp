#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <cmath>
#include <map>
#include <random>
#include <set>

#include "clustering/clusterer.h"
#include "clustering/iso_maker.h"
#include "clustering/topology_check.h"
#include "lamina/error.h"

namespace lamina {
namespace {

using test::CutMesh;
using test::FlatMesh;
using test::LatticeCase;
using test::Topology;

using Triangle = std::array<std::uint32_t, 3>;
/// A final vertex by what it is: kind, global corner, other corner (isovertices), t or position.
using VertexKey = std::tuple<int, std::uint32_t, std::uint32_t, float, std::array<float, 3>>;

struct Clustered {
  std::vector<VertexKey> vertices;
  std::vector<Triangle> triangles;
  ClusterCounts counts;
};

Clustered run(const CutMesh& mesh, ClusterMode mode) {
  Clusterer clusterer({mode});
  Clustered out;
  FinalSlab slab;
  std::size_t popped = 0;
  const auto drain = [&] {
    while (clusterer.pop(slab)) {
      ASSERT_EQ(slab.slab, mesh.slabs[popped]->slab);
      const auto global = [&](SlabIndex index) {
        return mesh.corner_ids[popped + (index.next() ? 1 : 0)][index.index()];
      };
      for (const FinalVertex& v : slab.vertices) {
        const bool patch = v.kind == FinalVertex::Kind::patch;
        const auto position = patch ? slab.patches[v.other.index()] : std::array<float, 3>{};
        out.vertices.emplace_back(static_cast<int>(v.kind), global(v.corner), global(patch ? v.corner : v.other), v.t,
                                  position);
      }
      for (const Triangle& t : slab.triangles) {
        for (const std::uint32_t index : t) ASSERT_LT(index, out.vertices.size()) << "not numbered yet";
        out.triangles.push_back(t);
      }
      ++popped;
    }
  };
  for (const auto& s : mesh.slabs) {
    clusterer.push(s);
    drain();
  }
  clusterer.finish();
  drain();
  EXPECT_EQ(popped, mesh.slabs.size());
  out.counts = clusterer.counts();
  return out;
}

/// The mesh free of numbering: its triangles by what their vertices are, rotated to begin at the least.
std::multiset<std::array<VertexKey, 3>> shape_of(const Clustered& mesh) {
  std::multiset<std::array<VertexKey, 3>> out;
  for (const Triangle& t : mesh.triangles) {
    std::array<VertexKey, 3> key{mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]};
    std::rotate(key.begin(), std::min_element(key.begin(), key.end()), key.end());
    out.insert(key);
  }
  return out;
}

Topology topology_of(const Clustered& mesh) {
  return test::topology_of(mesh.vertices.size(), mesh.triangles);
}
Topology topology_of(const FlatMesh& mesh) {
  return test::topology_of(mesh.vertices.size(), mesh.triangles);
}

std::uint32_t hash(std::uint32_t seed, int x, int y, int z, int w) {
  std::uint32_t h = seed * 2654435761U;
  for (const int v : {x, y, z, w}) h = (h ^ static_cast<std::uint32_t>(v + 77)) * 0x9E3779B1U, h ^= h >> 15;
  h *= 0x85EBCA77U;
  return h ^ h >> 13;
}

double uniform(std::uint32_t seed, int x, int y, int z, int w) {
  return hash(seed, x, y, z, w) / 4294967296.0;
}

/// Random lattices of every kind, by number.
LatticeCase random_case(std::uint32_t seed) {
  std::mt19937 random(seed);
  const auto pick = [&](int low, int high) { return low + static_cast<int>(random() % unsigned(high - low + 1)); };
  LatticeCase lattice;
  for (int& n : lattice.size) n = pick(3, 6);
  const auto [nx, ny, nz] = lattice.size;
  const bool closed = pick(0, 1) == 0;  // signs of the outer layer all alike
  const int kind = pick(0, 3);
  const double fill = 0.1 + 0.8 * uniform(seed, 1, 2, 3, 4);
  const double a = uniform(seed, 5, 0, 0, 0) * 2 - 1, b = uniform(seed, 6, 0, 0, 0) * 2 - 1;
  lattice.distance = [=](int x, int y, int z) {
    const bool outer = x == 0 || y == 0 || z == 0 || x == nx - 1 || y == ny - 1 || z == nz - 1;
    if (closed && outer) return 1.0;
    const double noise = uniform(seed, x, y, z, 0);
    switch (kind) {
      case 0:  // hostile: every sign by itself
        return noise - fill;
      case 1:  // a smooth blob or saddle
        return (x - 2.1) * (x - 2.1) + a * (y - 2.3) * (y - 2.3) + b * (z - 1.9) * (z - 1.9) - 2.2 + 0.01 * noise;
      case 2:  // a thin sheet with holes
        return std::abs(z - 2.0 - a * x - b * y) - 0.6 + (noise > 0.8 ? 0.5 : 0.0);
      default:  // a plane with noise
        return z - 1.7 - a * (x - 2) - b * (y - 2) + 1.5 * (noise - 0.5);
    }
  };
  if (pick(0, 1) == 0) {
    lattice.t = [seed](int x, int y, int z, int axis) {
      return static_cast<float>(0.01 + 0.98 * uniform(seed + 1, x, y, z, axis));
    };
  }
  if (pick(0, 2) == 0) {
    const double lost = 0.02 + 0.4 * uniform(seed, 9, 9, 9, 9);
    lattice.loop_accepted = [seed, lost](int x, int y, int z, int i) { return uniform(seed + 2, x, y, z, i) > lost; };
  }
  if (pick(0, 3) == 0) lattice.merge = 2;
  return lattice;
}

TEST(Clusterer, PreservesTheTopologyOfRandomMeshes) {
  std::size_t collapsed = 0, patches = 0, kept = 0, open = 0;
  for (std::uint32_t seed = 0; seed < 12000; ++seed) {
    const FlatMesh mesh = test::make_mesh(random_case(seed));
    const Topology before = topology_of(mesh);
    ASSERT_TRUE(before.manifold()) << "the generator, seed " << seed << ": " << before;
    const Clustered result = run(test::cut(mesh, 2 * (1 + static_cast<int>(seed % 3))), ClusterMode::preserving);
    const Topology after = topology_of(result);
    ASSERT_TRUE(after.manifold()) << "seed " << seed << ": " << after;
    ASSERT_TRUE(after.same_surface(before)) << "seed " << seed << ": " << before << " became " << after;
    collapsed += result.counts.collapsed;
    patches += result.counts.patches;
    kept += result.counts.kept_isovertices;
    open += before.loops > 0 ? 1 : 0;
  }
  EXPECT_GT(collapsed, 100000U);  // the cases do exercise every outcome
  EXPECT_GT(patches, 10000U);
  EXPECT_GT(kept, 100000U);
  EXPECT_GT(open, 3000U);
}

TEST(Clusterer, CollapsesExactlyWhatTheNaiveTestAllows) {
  for (std::uint32_t seed = 50000; seed < 51500; ++seed) {
    const FlatMesh mesh = test::make_mesh(random_case(seed));
    std::vector<std::uint32_t> cluster;
    for (const auto& v : mesh.vertices) cluster.push_back(v.cluster());
    const test::Reference reference = test::reference_verdicts(cluster, mesh.triangles);
    std::map<std::uint32_t, std::pair<int, int>> pieces;  // per cluster: components, collapsing ones
    for (const auto& [component, collapses] : reference.collapses) {
      auto& [all, collapsing] = pieces[cluster[component]];
      ++all;
      collapsing += collapses ? 1 : 0;
    }
    std::map<std::uint32_t, int> expected_corners, expected_patches, corners, patches;
    for (const auto& [corner, count] : pieces) {
      if (count.second > 0) (count.first == 1 ? expected_corners : expected_patches)[corner] = count.second;
    }
    const Clustered result = run(test::cut(mesh, 2), ClusterMode::preserving);
    for (const VertexKey& v : result.vertices) {
      if (std::get<0>(v) == static_cast<int>(FinalVertex::Kind::corner)) ++corners[std::get<1>(v)];
      if (std::get<0>(v) == static_cast<int>(FinalVertex::Kind::patch)) ++patches[std::get<1>(v)];
    }
    ASSERT_EQ(corners, expected_corners) << "seed " << seed;
    ASSERT_EQ(patches, expected_patches) << "seed " << seed;
    ASSERT_EQ(result.counts.corners, pieces.size()) << "seed " << seed;
  }
}

TEST(Clusterer, DoesNotDependOnTheCut) {
  for (std::uint32_t seed = 90000; seed < 90300; ++seed) {
    const FlatMesh mesh = test::make_mesh(random_case(seed));
    for (const ClusterMode mode : {ClusterMode::none, ClusterMode::free, ClusterMode::preserving}) {
      const auto whole = shape_of(run(test::cut(mesh, 64), mode));
      ASSERT_EQ(whole, shape_of(run(test::cut(mesh, 2), mode))) << "seed " << seed;
      ASSERT_EQ(whole, shape_of(run(test::cut(mesh, 4, 2), mode))) << "seed " << seed;
      if (random_case(seed).merge == 1) {
        ASSERT_EQ(whole, shape_of(run(test::cut(mesh, 1), mode))) << "seed " << seed;
        ASSERT_EQ(whole, shape_of(run(test::cut(mesh, 3, 1), mode))) << "seed " << seed;
      }
    }
  }
}

LatticeCase noisy_gyroid(int n) {
  LatticeCase lattice;
  lattice.size = {n, n, n};
  lattice.distance = [](int x, int y, int z) {
    const double f = 0.25;
    return std::sin(f * x) * std::cos(f * y) + std::sin(f * y) * std::cos(f * z) + std::sin(f * z) * std::cos(f * x) +
           0.4 * uniform(7, x, y, z, 0);
  };
  return lattice;
}

TEST(Clusterer, GivesTheSameBytesOnAnyNumberOfThreads) {
  const CutMesh mesh = test::cut(test::make_mesh(noisy_gyroid(70)), 40);
  for (const ClusterMode mode : {ClusterMode::none, ClusterMode::free, ClusterMode::preserving}) {
    tbb::task_arena one(1), two(2);  // two threads already work on eight chunks
    const Clustered serial = one.execute([&] { return run(mesh, mode); });
    const Clustered parallel = two.execute([&] { return run(mesh, mode); });
    EXPECT_EQ(serial.vertices, parallel.vertices);
    EXPECT_EQ(serial.triangles, parallel.triangles);
    EXPECT_EQ(serial.counts.resolved, parallel.counts.resolved);
  }
}

TEST(Clusterer, NoneKeepsTheMesh) {
  for (std::uint32_t seed = 70000; seed < 70300; ++seed) {
    const FlatMesh mesh = test::make_mesh(random_case(seed));
    const Clustered result = run(test::cut(mesh, 64), ClusterMode::none);
    ASSERT_EQ(result.triangles, mesh.triangles);
    ASSERT_EQ(result.vertices.size(), mesh.vertices.size());
    for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
      const FlatMesh::Vertex& iso = mesh.vertices[v];
      ASSERT_EQ(result.vertices[v], VertexKey(0, iso.low, iso.high, iso.t, std::array<float, 3>{}));
    }
    EXPECT_EQ(result.counts.kept_isovertices, mesh.vertices.size());
  }
}

TEST(Clusterer, FreeMergesEveryCluster) {
  for (std::uint32_t seed = 80000; seed < 80300; ++seed) {
    const FlatMesh mesh = test::make_mesh(random_case(seed));
    std::set<std::uint32_t> alive;
    std::size_t triangles = 0;
    for (const Triangle& t : mesh.triangles) {
      const std::set<std::uint32_t> corners{mesh.vertices[t[0]].cluster(), mesh.vertices[t[1]].cluster(),
                                            mesh.vertices[t[2]].cluster()};
      if (corners.size() < 3) continue;
      ++triangles;
      alive.insert(corners.begin(), corners.end());
    }
    const Clustered result = run(test::cut(mesh, 2), ClusterMode::free);
    ASSERT_EQ(result.triangles.size(), triangles);
    ASSERT_EQ(result.vertices.size(), alive.size());
    for (const VertexKey& v : result.vertices) {
      EXPECT_EQ(std::get<0>(v), static_cast<int>(FinalVertex::Kind::corner));
      EXPECT_EQ(alive.erase(std::get<1>(v)), 1U);
    }
  }
}

TEST(Clusterer, PlacesPatchesBesideTheirCorner) {
  std::size_t patches = 0;
  for (std::uint32_t seed = 60000; seed < 60500; ++seed) {
    LatticeCase lattice = random_case(seed);
    lattice.merge = 1;
    for (const VertexKey& v : run(test::cut(test::make_mesh(lattice), 2), ClusterMode::preserving).vertices) {
      if (std::get<0>(v) != static_cast<int>(FinalVertex::Kind::patch)) continue;
      ++patches;
      for (const float x : std::get<4>(v)) ASSERT_LE(std::abs(x), 0.76F * test::kCell);  // half of cell + half of that
    }
  }
  EXPECT_GT(patches, 500U);
}

TEST(Clusterer, SmoothSurfacesKeepAboutHalfTheirTriangles) {
  LatticeCase lattice;
  lattice.size = {40, 40, 40};
  lattice.distance = [](int x, int y, int z) { return std::hypot(x - 19.3, y - 19.6, z - 19.5) - 16.0; };
  const FlatMesh mesh = test::make_mesh(lattice);
  const Clustered result = run(test::cut(mesh, 8), ClusterMode::preserving);
  EXPECT_EQ(topology_of(result).euler, 2);
  EXPECT_EQ(result.counts.kept_isovertices, 0U);
  EXPECT_LT(result.triangles.size(), mesh.triangles.size() * 6 / 10);
}

TEST(Clusterer, LeavesATinyBlobAsItIs) {
  LatticeCase lattice;
  lattice.size = {5, 5, 5};
  lattice.distance = [](int x, int y, int z) { return x == 2 && y == 2 && z == 2 ? -1.0 : 2.0; };
  const Clustered result = run(test::cut(test::make_mesh(lattice), 2), ClusterMode::preserving);
  EXPECT_EQ(result.vertices.size(), 6U);
  EXPECT_EQ(result.triangles.size(), 8U);
  EXPECT_EQ(run(test::cut(test::make_mesh(lattice), 2), ClusterMode::free).triangles.size(), 0U);
}

TEST(Clusterer, EmptySlabsPassThrough) {
  Clusterer nothing({ClusterMode::preserving});
  nothing.finish();
  FinalSlab slab;
  EXPECT_FALSE(nothing.pop(slab));
  Clusterer empty({ClusterMode::preserving});
  for (std::int64_t s = -2; s < 3; ++s) {
    auto iso = std::make_shared<IsoSlab>();
    iso->slab = s;
    empty.push(iso);
  }
  empty.finish();
  for (std::int64_t s = -2; s < 3; ++s) {
    ASSERT_TRUE(empty.pop(slab));
    EXPECT_EQ(slab.slab, s);
    EXPECT_TRUE(slab.vertices.empty() && slab.triangles.empty());
  }
  EXPECT_FALSE(empty.pop(slab));
}

TEST(Clusterer, RefusesBrokenSlabs) {
  const auto pushed = [](const IsoSlab& broken) {
    Clusterer clusterer({ClusterMode::preserving});
    clusterer.push(std::make_shared<IsoSlab>(broken));
    clusterer.finish();
  };
  IsoSlab slab;
  slab.corners.resize(2);
  slab.vertices.resize(3, {SlabIndex{0}, SlabIndex{1}, 0.5F, 0, 0, false});
  EXPECT_NO_THROW(pushed(slab));
  IsoSlab bad_corner = slab;
  bad_corner.vertices[1].high = {7};
  EXPECT_THROW(pushed(bad_corner), Error);
  bad_corner.vertices[1].high = {SlabIndex::kNextSlab};
  EXPECT_THROW(pushed(bad_corner), Error);
  IsoSlab bad_vertex = slab;
  bad_vertex.triangles.push_back({SlabIndex{0}, SlabIndex{1}, SlabIndex{3}});
  EXPECT_THROW(pushed(bad_vertex), Error);
  bad_vertex.triangles.back()[2] = {SlabIndex::kNextSlab};
  EXPECT_THROW(pushed(bad_vertex), Error);
  Clusterer gap({ClusterMode::preserving});
  gap.push(std::make_shared<IsoSlab>(slab));
  slab.slab = 2;
  EXPECT_THROW(gap.push(std::make_shared<IsoSlab>(slab)), Error);
}

}  // namespace
}  // namespace lamina
