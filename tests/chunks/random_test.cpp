// Whatever the cloud and the settings: chunks make the mesh that one run makes.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "chunks/chunked.h"

namespace lamina {
namespace {

using test::Cloud;
using test::Point3;

/// Pieces of spheres and sheets, clumps and dust along a line, with radii and normals that may make no sense.
Cloud random_cloud(std::mt19937& random) {
  std::uniform_real_distribution<> uniform;
  const auto pick = [&](unsigned n) { return static_cast<unsigned>(random() % n); };
  Cloud cloud;
  const unsigned bodies = 1 + pick(6);
  for (unsigned b = 0; b < bodies; ++b) {
    const Point3 centre{uniform(random), uniform(random), 6 * uniform(random)};
    const double size = std::exp2(-1 - 3 * uniform(random));
    const unsigned kind = pick(3), samples = 60 + pick(400);
    for (unsigned i = 0; i < samples; ++i) {
      const Point3 n = test::random_direction(random);
      Point3 p = n;
      if (kind == 1) p = {uniform(random), uniform(random), 3 * uniform(random)};
      if (kind == 2) p = {uniform(random), 0.01 * uniform(random), 4 * uniform(random)};
      for (std::size_t k = 0; k < 3; ++k) p[k] = centre[k] + size * p[k];
      cloud.add(p, kind == 2 ? Point3{0, pick(9) == 0 ? -1.0 : 1.0, 0.2} : n);
    }
  }
  if (pick(3) == 0) {
    const double spread = 4 * uniform(random);
    cloud.add_property("radius", ScalarType::float32,
                       [&](const Point3&) { return 0.03 * std::exp2(spread * (uniform(random) - 0.5)); });
  }
  return cloud;
}

SurfaceSettings random_settings(std::mt19937& random) {
  const auto pick = [&](unsigned n) { return static_cast<unsigned>(random() % n); };
  SurfaceSettings s;
  s.blend = std::array{1.0, 1.2, 2.0, 3.0}[pick(4)];
  s.steps = 1 + static_cast<int>(pick(3));
  s.diffuse = pick(4) == 0;
  s.cluster = static_cast<ClusterMode>(pick(3));
  s.levels = pick(2) == 0 ? 0 : 1 + static_cast<int>(pick(4));
  s.boundary = pick(3) == 0 ? 0.6 : 0;
  s.density = 3 + pick(20);
  s.window = 1 + static_cast<int>(pick(3));
  if (pick(3) == 0) s.cell = {0.9, Length::Unit::sample_radius};
  if (pick(4) == 0) s.max_radius = {3.0, Length::Unit::sample_radius};
  return s;
}

void expect_same(unsigned seed) {
  std::mt19937 random(seed);
  const test::TemporaryFolder folder;
  SurfaceSettings settings = random_settings(random);
  settings.input = test::write_cloud(random_cloud(random), folder / "in.ply");
  const std::string whole = test::whole_bytes(settings, folder);
  if (!whole.starts_with("ply")) return;  // no surface, or no lattice holds it: others test that
  write_store(settings, folder / "store", {});
  const int count = 2 + static_cast<int>(random() % 9);
  RC_ASSERT(test::merged_bytes(test::make_parts(settings, folder / "store", count, folder), folder) == whole);
}

RC_GTEST_PROP(ChunkRandom, SameBytes, (unsigned seed)) {
  // A hundred take ten seconds; each run has another few. RC_PARAMS=max_success=10000 tries 400.
  if (seed % 25 == 0) expect_same(seed);
}

}  // namespace
}  // namespace lamina
