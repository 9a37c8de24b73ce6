// Small parts leave a streamed mesh; the truth is the whole mesh in memory.
#include "reconstruct/pruner.h"

#include <gtest/gtest.h>

#include <rapidcheck/gtest.h>
#include <Eigen/Geometry>
#include <cmath>
#include <map>
#include <numeric>
#include <random>

#include "base/temporary_folder.h"
#include "lamina/error.h"
#include "lamina/mesh.h"
#include "support/heap.h"

namespace lamina {
namespace {

using Triangle = std::array<std::uint32_t, 3>;

struct SlabMesh {
  VertexBatch vertices;
  std::vector<Triangle> triangles;
};

/// Slabs of a few vertices, joined at random within the slab and with the one before.
std::vector<SlabMesh> random_slabs(std::mt19937& random, std::size_t slabs, std::uint32_t most, double joined) {
  std::uniform_real_distribution<> uniform;
  std::vector<SlabMesh> out(slabs);
  std::uint32_t below = 0, first = 0;
  for (std::size_t s = 0; s < slabs; ++s) {
    SlabMesh& slab = out[s];
    const auto n = static_cast<std::uint32_t>(uniform(random) * (most + 1));
    slab.vertices.attributes.resize(1);
    for (std::uint32_t i = 0; i < n; ++i) {
      slab.vertices.x.push_back(uniform(random));
      slab.vertices.y.push_back(first + i);  // the vertex' own number, for recognising it
      slab.vertices.z.push_back(static_cast<double>(s));
      slab.vertices.nx.push_back(0), slab.vertices.ny.push_back(0), slab.vertices.nz.push_back(1);
      slab.vertices.attributes[0].push_back(static_cast<float>(first + i) * 0.5F);
      slab.vertices.density.push_back(uniform(random) < 0.3 ? 0.0F : static_cast<float>(uniform(random)));
    }
    const std::uint32_t range = first + n - below;
    for (std::uint32_t t = 0; range >= 3 && t < static_cast<std::uint32_t>(joined * n); ++t) {
      Triangle v{};
      for (auto& corner : v) corner = below + static_cast<std::uint32_t>(uniform(random) * range) % range;
      if (v[0] != v[1] && v[1] != v[2] && v[2] != v[0]) slab.triangles.push_back(v);
    }
    below = first;
    first += n;
  }
  return out;
}

struct Truth {
  std::vector<double> names;  ///< y of the vertices that stay, in order
  std::vector<Triangle> triangles;
  PruneCounts counts;
};

Truth prune_whole(const std::vector<SlabMesh>& slabs, const PruneRule& rule) {
  std::vector<std::array<double, 3>> at;
  std::vector<double> density;
  std::vector<Triangle> triangles;
  for (const SlabMesh& s : slabs) {
    for (std::size_t i = 0; i < s.vertices.size(); ++i)
      at.push_back({s.vertices.x[i], s.vertices.y[i], s.vertices.z[i]});
    density.insert(density.end(), s.vertices.density.begin(), s.vertices.density.end());
    triangles.insert(triangles.end(), s.triangles.begin(), s.triangles.end());
  }
  // Labels spread until nothing changes.
  std::vector<std::uint32_t> label(at.size());
  std::iota(label.begin(), label.end(), 0U);
  for (bool changed = true; changed;) {
    changed = false;
    for (const Triangle& t : triangles) {
      const std::uint32_t least = std::min({label[t[0]], label[t[1]], label[t[2]]});
      for (const std::uint32_t v : t) {
        changed = changed || label[v] != least;
        label[v] = least;
      }
    }
  }
  struct Part {
    std::uint64_t triangles = 0;
    double samples = 0;
    std::array<double, 3> low{1e9, 1e9, 1e9}, high{-1e9, -1e9, -1e9};
  };
  std::map<std::uint32_t, Part> parts;
  for (std::size_t v = 0; v < at.size(); ++v) {
    Part& p = parts[label[v]];
    for (std::size_t k = 0; k < 3; ++k)
      p.low[k] = std::min(p.low[k], at[v][k]), p.high[k] = std::max(p.high[k], at[v][k]);
  }
  for (const Triangle& t : triangles) {
    Part& p = parts[label[t[0]]];
    ++p.triangles;
    const Eigen::Vector3d a(at[t[0]].data()), b(at[t[1]].data()), c(at[t[2]].data());
    double sum = 0, known = 0;
    for (const std::uint32_t v : t) sum += density[v], known += density[v] > 0 ? 1 : 0;
    if (known > 0) p.samples += sum / known * (b - a).cross(c - a).norm() / 2;
  }
  const auto stays = [&](std::uint32_t v) {
    const Part& p = parts[label[v]];
    const double size = std::hypot(p.high[0] - p.low[0], p.high[1] - p.low[1], p.high[2] - p.low[2]);
    return p.triangles > 0 && p.triangles >= rule.triangles && p.samples >= static_cast<double>(rule.samples) &&
           size >= rule.size;
  };
  Truth truth;
  std::vector<std::uint32_t> number(at.size());
  for (std::uint32_t v = 0; v < at.size(); ++v) {
    number[v] = static_cast<std::uint32_t>(truth.names.size());
    if (stays(v)) truth.names.push_back(at[v][1]);
  }
  for (const Triangle& t : triangles) {
    if (stays(t[0])) truth.triangles.push_back({number[t[0]], number[t[1]], number[t[2]]});
  }
  for (const auto& [v, p] : parts) {
    if (p.triangles == 0) continue;
    if (stays(v)) {
      ++truth.counts.kept;
    } else {
      ++truth.counts.removed;
      truth.counts.removed_triangles += p.triangles;
    }
  }
  return truth;
}

std::string prune_streamed(const std::vector<SlabMesh>& slabs, const PruneRule& rule, std::uint64_t memory,
                           const std::string& folder, PruneCounts& counts) {
  MeshSinkSettings settings;
  settings.path = folder + "/mesh.ply";
  settings.attributes = {{"value", ScalarType::float32}};
  settings.double_positions = true;
  const auto next = open_whole_mesh(settings, nullptr);
  Pruner pruner(rule, folder, *next, memory);
  for (const SlabMesh& s : slabs) pruner.add(s.vertices, s.triangles);
  pruner.finish();
  EXPECT_EQ(pruner.disk_bytes(), 0U);
  counts = pruner.counts();
  next->commit({});
  return settings.path;
}

RC_GTEST_PROP(Pruner, LeavesWhatTheWholeMeshWouldLeaveWhateverItsMemory, ()) {
  std::mt19937 random(*rc::gen::arbitrary<unsigned>());
  const auto slabs = random_slabs(random, *rc::gen::inRange<std::size_t>(1, 12), *rc::gen::inRange(1U, 30U),
                                  *rc::gen::element(0.2, 0.6, 2.0));
  const PruneRule rule{*rc::gen::element(std::uint64_t{0}, std::uint64_t{1}, std::uint64_t{3}, std::uint64_t{20}),
                       *rc::gen::element(std::uint64_t{0}, std::uint64_t{5}, std::uint64_t{40}),
                       *rc::gen::element(0.0, 4.0, 30.0)};
  const Truth truth = prune_whole(slabs, rule);
  const test::TemporaryFolder folder;
  std::string bytes;
  for (const std::uint64_t memory : {std::uint64_t{0}, std::uint64_t{1000}, std::uint64_t{1} << 30}) {
    PruneCounts counts;
    const std::string path = prune_streamed(slabs, rule, memory, folder.path(), counts);
    RC_ASSERT(counts.kept == truth.counts.kept);
    RC_ASSERT(counts.removed == truth.counts.removed);
    RC_ASSERT(counts.removed_triangles == truth.counts.removed_triangles);
    if (bytes.empty()) bytes = test::read_file(path);
    RC_ASSERT(test::read_file(path) == bytes);
    if (truth.names.empty()) continue;
    const TriangleMesh mesh = read_mesh(path);
    RC_ASSERT(mesh.triangles == truth.triangles);
    std::vector<double> names;
    for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
      names.push_back(mesh.positions[v][1]);
      RC_ASSERT(mesh.attributes[0][v] == static_cast<float>(mesh.positions[v][1]) * 0.5F);
    }
    RC_ASSERT(names == truth.names);
  }
}

TEST(Pruner, TrianglesThatReachFartherBackAreRefused) {
  std::mt19937 random(4);
  const test::TemporaryFolder folder;
  auto slabs = random_slabs(random, 3, 8, 0);
  for (SlabMesh& s : slabs) ASSERT_GT(s.vertices.size(), 2U);
  slabs[2].triangles.push_back({0, 1, 2});
  PruneCounts counts;
  EXPECT_THROW(prune_streamed(slabs, {.triangles = 2}, 0, folder.path(), counts), Error);
  EXPECT_EQ(folder.entries(), 0);
}

/// Takes what stays and keeps none of it.
class Nowhere final : public SlabSink {
 public:
  void write(const MeshSlab&) override {}
};

TEST(Pruner, WhatWaitsInTheFileDoesNotWaitInMemory) {
  if (!test::heap_is_counted()) GTEST_SKIP() << "the heap is a sanitizer's";
  // One slab of many triangles that may still turn out to be small.
  std::mt19937 random(1);
  const auto slabs = random_slabs(random, 1, 3000, 60);
  const std::size_t bytes = slabs[0].triangles.size() * sizeof(Triangle);
  ASSERT_GT(bytes, 200'000U);
  const test::TemporaryFolder folder;
  Nowhere next;
  Pruner pruner({.triangles = 1'000'000'000}, folder.path(), next, 0);
  const std::size_t before = test::heap_bytes();
  pruner.add(slabs[0].vertices, slabs[0].triangles);
  EXPECT_GE(pruner.disk_bytes(), bytes);
  EXPECT_LT(test::heap_bytes(), before + bytes / 2);
}

TEST(Pruner, AFullDiskIsSaid) {
  std::mt19937 random(1);
  const test::TemporaryFolder folder;
  MeshSinkSettings settings;
  settings.path = folder / "mesh.ply";
  settings.attributes = {{"value", ScalarType::float32}};
  const auto next = open_whole_mesh(settings, nullptr);
  Pruner pruner({5, 0}, folder / "none", *next, 0);
  try {
    const auto slabs = random_slabs(random, 2, 9, 0.5);
    for (const SlabMesh& s : slabs) pruner.add(s.vertices, s.triangles);
    ADD_FAILURE() << "no error";
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ExitCode::budget);
    EXPECT_NE(std::string(e.what()).find("none"), std::string::npos);
  }
}

}  // namespace
}  // namespace lamina
