// Whatever bytes come in: an Error in one line, or a mesh that is one.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <Eigen/Geometry>

#include "lamina/error.h"
#include "reconstruct/clouds.h"

namespace lamina {
namespace {

using test::Cloud;

/// Below `n`.
unsigned pick(std::mt19937& random, std::size_t n) {
  return static_cast<unsigned>(random() % n);
}

/// A mesh whose indices and numbers hold, or an Error that leaves nothing.
void expect_mesh_or_error(const std::string& bytes, SurfaceSettings settings = {}, bool manifold = true) {
  const test::TemporaryFolder folder;
  settings.input = test::write_file(folder / "in.ply", bytes);
  settings.output = folder / "out.ply";
  try {
    const SurfaceStats stats = reconstruct_surface(settings, {});
    const TriangleMesh mesh = read_mesh(settings.output);  // refuses what is not finite or not there
    RC_ASSERT(mesh.triangles.size() == stats.triangles);
    RC_ASSERT(mesh.positions.size() == stats.vertices);
    RC_ASSERT(stats.triangles > 0);
    const test::MeshFacts facts = test::check_mesh(mesh.triangles);
    RC_ASSERT(!manifold || settings.cluster == ClusterMode::free || facts.is_manifold());
    RC_ASSERT(folder.entries() == 2);
  } catch (const Error& e) {
    const std::string said = e.what();
    // A message about a defect of the program is a defect.
    if (e.code() == ExitCode::internal) RC_FAIL(said);
    RC_ASSERT(said.find('\n') == std::string::npos);
    RC_ASSERT(said.find("in.ply") != std::string::npos || e.code() == ExitCode::usage);
    RC_ASSERT(folder.entries() == 1);
  }
}

Cloud small_cloud() {
  Cloud cloud = test::sphere_cloud(300);
  cloud.add_property("red", ScalarType::uint8, [](const test::Point3&) { return 9.0; });
  cloud.add_property("radius", ScalarType::float32, [](const test::Point3&) { return 0.4; });
  cloud.add_property("t", ScalarType::float64, [](const test::Point3& p) { return p[0]; });
  return cloud;
}

RC_GTEST_PROP(SurfaceFuzz, RandomBytesAfterAHeader, (unsigned seed)) {
  std::mt19937 random(seed);
  const auto format = static_cast<PlyFormat>(pick(random, 3));
  std::string bytes = test::ply_bytes(test::ply_model(small_cloud()), format);
  const std::size_t body = bytes.find("end_header\n", bytes.find("property")) + 11;
  for (std::size_t i = body; i < bytes.size(); ++i) {
    if (format != PlyFormat::ascii || bytes[i] != '\n') bytes[i] = static_cast<char>(random());
  }
  expect_mesh_or_error(bytes);
}

RC_GTEST_PROP(SurfaceFuzz, SomeBytesAnywhere, (unsigned seed)) {
  std::mt19937 random(seed);
  static const Cloud cloud = small_cloud();
  std::string bytes = test::ply_bytes(test::ply_model(cloud), static_cast<PlyFormat>(pick(random, 3)));
  const bool header = pick(random, 2) == 0;
  const unsigned changes = 1 + pick(random, 20);
  for (unsigned i = 0; i < changes; ++i) {
    const std::size_t within = header ? 300 : bytes.size();
    const std::size_t at = pick(random, within);
    switch (pick(random, 4)) {
      case 0:
        bytes[at] = static_cast<char>(random());
        break;
      case 1:
        bytes.erase(at, 1 + pick(random, 4));
        break;
      case 2:
        bytes.insert(at, bytes, pick(random, within), 1 + pick(random, 12));
        break;
      default:
        bytes[at] = static_cast<char>('0' + pick(random, 10));
    }
  }
  expect_mesh_or_error(bytes);
}

RC_GTEST_PROP(SurfaceFuzz, CutAnywhere, (unsigned seed)) {
  std::mt19937 random(seed);
  static const Cloud cloud = small_cloud();
  const std::string bytes = test::ply_bytes(test::ply_model(cloud), static_cast<PlyFormat>(pick(random, 3)));
  expect_mesh_or_error(bytes.substr(0, pick(random, bytes.size())));
}

/// Numbers of every size, among them the ones that other programs choke on.
double wild(std::mt19937& random) {
  constexpr double kSpecial[] = {0, -0.0, 1, -1, 1e-40, 3e38, -3e38, 1e20};
  if (pick(random, 8) == 0) return std::nan("");
  if (pick(random, 8) == 0) return std::numeric_limits<double>::infinity();
  if (pick(random, 2) == 0) return kSpecial[pick(random, 8)];
  return std::ldexp(std::normal_distribution<>()(random), static_cast<int>(pick(random, 200)) - 100);
}

// Well-formed files with samples that make no sense.
RC_GTEST_PROP(SurfaceFuzz, WildNumbers, (unsigned seed)) {
  std::mt19937 random(seed);
  Cloud cloud = test::sphere_cloud(50 + pick(random, 100));
  for (const char* name : {"radius", "quality", "t"}) {
    if (pick(random, 2) == 0) continue;
    const bool mad = pick(random, 2) == 0;
    cloud.add_property(name, ScalarType::float32, [&](const test::Point3&) { return mad ? wild(random) : 0.5; });
  }
  const unsigned share = 2 + pick(random, 100);
  const bool moved = pick(random, 2) == 0;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (pick(random, share) != 0) continue;
    // Positions stay near: a sweep through a long gap takes its time.
    (moved ? cloud.positions : cloud.normals)[i][pick(random, 3)] = moved ? std::fmod(wild(random), 20) : wild(random);
  }
  SurfaceSettings s;
  s.blend = std::exp2(static_cast<int>(pick(random, 4)) - 1);
  s.steps = 1 + static_cast<int>(pick(random, 3));
  s.diffuse = pick(random, 4) == 0;
  s.cluster = static_cast<ClusterMode>(pick(random, 3));
  s.fit = static_cast<FitMode>(pick(random, 2));
  s.levels = pick(random, 2) == 0 ? 0 : 1 + static_cast<int>(pick(random, 5));
  s.boundary = pick(random, 3) == 0 ? 0.5 : 0;
  s.density = 2 + pick(random, 30);
  expect_mesh_or_error(test::ply_bytes(test::ply_model(cloud), PlyFormat::little_endian), s);
}

// Shapes no surface comes from, or only a bad one: lines, few places, volumes, contradicting normals.
Cloud shape_that_is_no_surface(std::mt19937& random) {
  const unsigned dimensions = pick(random, 4);
  const unsigned places = pick(random, 3) == 0 ? 1 + pick(random, 5) : 1u << 30;
  const bool honest = pick(random, 2) == 0;
  const Eigen::Matrix3d turn =
      Eigen::Quaterniond(1, 0.1 * (pick(random, 10)), 0.1 * (pick(random, 10)), 0).normalized().toRotationMatrix();
  Cloud cloud;
  const std::size_t count = 1 + pick(random, 2000);
  std::uniform_real_distribution<> uniform;
  for (std::size_t i = 0; i < count; ++i) {
    Eigen::Vector3d p = Eigen::Vector3d::Zero();
    for (unsigned k = 0; k < dimensions; ++k) p[k] = places < 10 ? pick(random, places) : uniform(random);
    p = turn * p;
    cloud.add({p[0], p[1], p[2]}, honest ? test::Point3{0, 0, 1} : test::random_direction(random));
  }
  return cloud;
}

RC_GTEST_PROP(SurfaceFuzz, ShapesThatAreNoSurfaces, (unsigned seed)) {
  std::mt19937 random(seed);
  const Cloud cloud = shape_that_is_no_surface(random);
  SurfaceSettings s;
  s.cluster = static_cast<ClusterMode>(pick(random, 3));
  s.blend = 1 + pick(random, 3);
  expect_mesh_or_error(test::ply_bytes(test::ply_model(cloud), PlyFormat::little_endian), s);
}

// The same with all that is done beside the plain way, and a cell or support of any size.
RC_GTEST_PROP(SurfaceFuzz, BadShapesWithAnySettings, (unsigned seed)) {
  std::mt19937 random(seed);
  const Cloud cloud =
      pick(random, 3) == 0 ? test::sphere_cloud(50 + pick(random, 500)) : shape_that_is_no_surface(random);
  const auto maybe = [&](auto value, auto otherwise) { return pick(random, 3) == 0 ? value : otherwise; };
  SurfaceSettings s;
  s.blend = maybe(std::optional<double>(), std::optional<double>(0.5 + 0.1 * pick(random, 40)));
  if (pick(random, 3) == 0) s.cell = Length{0.3 + 0.1 * pick(random, 15), Length::Unit::influence_radius};
  if (pick(random, 3) == 0) s.refit = pick(random, 9);
  s.cluster = static_cast<ClusterMode>(pick(random, 3));
  s.close_holes = s.cluster == ClusterMode::free ? 0 : maybe(40.0, 8.0);
  if (s.close_holes > 0 && pick(random, 2) == 0) s.watertight = pick(random, 3) > 0;
  if (s.close_holes > 0 && pick(random, 2) == 0) s.bridge = pick(random, 3) > 0;
  s.steps = static_cast<int>(pick(random, 5));
  s.diffuse = maybe(true, false);
  s.fit = static_cast<FitMode>(pick(random, 2));
  s.levels = static_cast<int>(pick(random, 5));
  s.density = 2 + pick(random, 30);
  s.chord = maybe(1.0, 0.2);
  s.window = 1 + static_cast<int>(pick(random, 4));
  s.vertex_curvature = maybe(true, false);
  s.prune_triangles = maybe(5, 0);
  expect_mesh_or_error(test::ply_bytes(test::ply_model(cloud), PlyFormat::little_endian), s);
}

// Values as far above the highest sample as cells reach: these cells have upper corners, too.
TEST(SurfaceFuzz, SurfaceInTheLastCells) {
  std::mt19937 random(253987912);
  SurfaceSettings s;
  const Cloud cloud = shape_that_is_no_surface(random);
  s.blend = 3;
  EXPECT_TRUE(test::reconstruct(cloud, s).facts.is_manifold());
}

}  // namespace
}  // namespace lamina
