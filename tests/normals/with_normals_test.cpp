// Normals against clouds whose truth is known.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstddef>
#include <filesystem>
#include <limits>
#include <random>

#include "lamina/error.h"
#include "lamina/scatter.h"
#include "normals/clouds.h"
#include "support/paths.h"

namespace lamina {
namespace {

using test::compare;
using test::find_normals;
using test::Found;
using test::in_mode;
using test::kNan;
using test::Oriented;
using test::Quality;
using test::Vector;

void expect_good(const Quality& q) {
  EXPECT_GT(q.close, 0.99);
  EXPECT_GT(q.right_side, 0.999);
}

TEST(WithNormals, OfASphereAndATorusPointOutward) {
  for (const int k : {8, 16}) {
    NormalsSettings settings;
    settings.k = k;
    Oriented sphere;
    test::add_sphere(sphere, 4000, 2, {400000, 5000000, 100});
    expect_good(compare(sphere, find_normals(sphere, settings).normals));
    Oriented torus;
    test::add_torus(torus, 10000);
    const Found found = find_normals(torus, settings);
    expect_good(compare(torus, found.normals));
    EXPECT_EQ(found.report.samples, torus.size());
    EXPECT_EQ(found.report.estimated, torus.size());
    EXPECT_EQ(found.report.by_outside, torus.size());
    EXPECT_EQ(found.report.components, 1);
    EXPECT_LT(found.report.conflicts.share(), 0.001);
    EXPECT_GT(found.report.conflicts.pairs, 4 * torus.size());
  }
}

TEST(WithNormals, OfABumpySphereAreItsOwn) {
  const auto surface = shape_surface("bumpy-sphere", false);
  Oriented cloud;
  for (std::uint64_t i = 0; i < 12000; ++i) {
    const Surface::Point p = surface->point(1, i, 0);
    cloud.add(p.position, p.normal);
  }
  expect_good(compare(cloud, find_normals(cloud, in_mode(NormalsMode::estimate, 8)).normals));
}

TEST(WithNormals, WithinARadiusAreAsGood) {
  Oriented torus;
  test::add_torus(torus, 10000);
  NormalsSettings settings;
  settings.radius = 0.1;
  expect_good(compare(torus, find_normals(torus, settings).normals));
}

TEST(WithNormals, OfNestedShellsEachPointOutward) {
  Oriented cloud;
  test::add_sphere(cloud, 6000, 1);
  test::add_sphere(cloud, 6000, 0.85);
  const Found found = find_normals(cloud);
  expect_good(compare(cloud, found.normals));
  EXPECT_EQ(found.report.components, 2);
}

// The two sides of a plate three spacings thick: neighbours reach across its rim only.
TEST(WithNormals, OfAPlateKeepItsSidesApart) {
  Oriented cloud;
  test::add_sheet(cloud, 8000, [](double, double) { return 0.05; });
  const std::size_t half = cloud.size();
  test::add_sheet(cloud, 8000, [](double, double) { return 0.0; });
  for (std::size_t i = half; i < cloud.size(); ++i) cloud.normals[i][2] = -1;
  const Found found = find_normals(cloud, in_mode(NormalsMode::estimate, 8));
  // Sheets that nothing joins are each too flat to have an outside.
  std::array<double, 2> up{};
  for (std::size_t i = 0; i < cloud.size(); ++i) up.at(i / half) += found.normals[i][2] / static_cast<double>(half);
  EXPECT_GT(std::abs(up[0]), 0.999);
  EXPECT_GT(std::abs(up[1]), 0.999);
  EXPECT_EQ(found.report.by_up + found.report.unsure, cloud.size());
}

TEST(WithNormals, OfAnOpenSheetFaceUp) {
  const auto hills = [](double x, double y) { return 0.1 * std::sin(9 * x) * std::cos(7 * y); };
  Oriented cloud;
  test::add_sheet(cloud, 6000, hills);
  NormalsSettings settings;
  settings.viewpoints = {{{0, 0, 1}, true}};
  const Found up = find_normals(cloud, settings);
  expect_good(compare(cloud, up.normals));
  EXPECT_EQ(up.report.by_viewpoint, cloud.size());

  settings.viewpoints = {{{0, 0, -1}, true}};
  EXPECT_LT(compare(cloud, find_normals(cloud, settings).normals).right_side, 0.001);
  settings.flip = true;
  EXPECT_GT(compare(cloud, find_normals(cloud, settings).normals).right_side, 0.999);
}

// From inside, walls seen at a grazing angle get their sign from those seen straight on.
TEST(WithNormals, FaceAViewpointInside) {
  Oriented cloud;
  test::add_sphere(cloud, 6000, 1);
  NormalsSettings settings;
  settings.viewpoints = {{{0.9, 0, 0}, false}};
  EXPECT_EQ(compare(cloud, find_normals(cloud, settings).normals).right_side, 0);
  settings.viewpoints = {{{3, 0, 0}, false}, {{-3, 0, 0}, false}, {{0, 3, 0}, false}, {{0, -3, 0}, false}};
  EXPECT_GT(compare(cloud, find_normals(cloud, settings).normals).right_side, 0.999);
}

TEST(WithNormals, FaceTheScannerOfTheirOwnScan) {
  Oriented cloud;
  const auto flat = [](double, double) { return 0.0; };
  test::add_sheet(cloud, 3000, flat);
  cloud.scans = {{0, ScanPart::Scanner::position, {0.5, 0.5, 2}}, {3000, ScanPart::Scanner::direction, {0, 0, -1}}};
  const std::size_t half = cloud.size();
  test::add_sheet(cloud, 3000, flat);
  for (std::size_t i = half; i < cloud.size(); ++i) {
    cloud.positions[i][2] -= 1;
    cloud.normals[i][2] = -1;
  }
  EXPECT_EQ(compare(cloud, find_normals(cloud).normals).right_side, 1);
  // Viewpoints told win: one for each scan.
  NormalsSettings settings;
  settings.viewpoints = {{{0.5, 0.5, -5}, false}, {{0.5, 0.5, 5}, false}};
  EXPECT_EQ(compare(cloud, find_normals(cloud, settings).normals).right_side, 0);
  settings.viewpoints.clear();
  settings.scanners = false;
  EXPECT_EQ(find_normals(cloud, settings).report.by_viewpoint, 0);
}

TEST(WithNormals, OriginsOfPosesCountWhenAsked) {
  Oriented cloud;
  test::add_sheet(cloud, 3000, [](double, double) { return 0.0; });
  cloud.scans = {{0, ScanPart::Scanner::pose_origin, {0.5, 0.5, 2}}};
  NormalsSettings settings;
  EXPECT_EQ(find_normals(cloud, settings).report.by_viewpoint, 0);
  settings.pose_origins = true;
  EXPECT_EQ(compare(cloud, find_normals(cloud, settings).normals).right_side, 1);
}

TEST(WithNormals, LeavesSamplesWithoutAPlaneAlone) {
  Oriented cloud;
  test::add_sphere(cloud, 3000, 1);
  cloud.add({40, 0, 0}, {1, 0, 0});    // on its own
  cloud.add({kNan, 0, 0}, {1, 0, 0});  // nowhere
  const Found found = find_normals(cloud);
  EXPECT_EQ(found.report.without, 1);
  EXPECT_EQ(found.report.samples, 3001);
  EXPECT_EQ(found.normals[3000], (Vector{0, 0, 0}));
  EXPECT_EQ(found.normals[3001], (Vector{0, 0, 0}));
}

// Lines of a scanner thirty times closer along than across: the nearest sixteen lie on one.
TEST(WithNormals, OfScanLinesReachAcross) {
  Oriented cloud;
  for (int line = 0; line < 60; ++line) {
    for (int i = 0; i < 400; ++i) {
      const double a = 0.01 * line;
      cloud.add({i * 0.001, std::sin(a), std::cos(a)}, {0, std::sin(a), std::cos(a)});
    }
  }
  NormalsSettings settings;
  settings.viewpoints = {{{0, 0, 1}, true}};
  expect_good(compare(cloud, find_normals(cloud, settings).normals));
}

/// Faces of a box, without those that stand on a floor; normals outward, or inward.
struct Box {
  Vector low, high;
  bool inward = false, stands = true;

  void scatter(Oriented& cloud, double per_area, std::mt19937& random) const {
    std::uniform_real_distribution<> uniform;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (const bool upper : {false, true}) {
        if (axis == 2 && !upper && stands) continue;
        const std::size_t u = (axis + 1) % 3;
        const std::size_t v = (axis + 2) % 3;
        const auto count = static_cast<int>(per_area * (high[u] - low[u]) * (high[v] - low[v]));
        for (int i = 0; i < count; ++i) {
          Vector p{};
          p[axis] = upper ? high[axis] : low[axis];
          p[u] = low[u] + uniform(random) * (high[u] - low[u]);
          p[v] = low[v] + uniform(random) * (high[v] - low[v]);
          Vector n{};
          n[axis] = upper != inward ? 1 : -1;
          cloud.add(p, n);
        }
      }
    }
  }
};

TEST(WithNormals, OfAFurnishedRoomFaceIn) {
  std::mt19937 random(4);
  Oriented cloud;
  constexpr double kPerArea = 1200;
  Box{{0, 0, 0}, {5, 6, 2.7}, true, false}.scatter(cloud, kPerArea, random);
  Oriented empty = cloud;
  Box{{0.8, 0.8, 0}, {2.6, 2.2, 0.9}}.scatter(cloud, kPerArea, random);
  Box{{3.2, 3.5, 0}, {4.2, 5, 1.9}}.scatter(cloud, kPerArea, random);
  // What stands there hides the floor.
  Oriented seen;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const Vector& p = cloud.positions[i];
    const bool below =
        (p[0] > 0.8 && p[0] < 2.6 && p[1] > 0.8 && p[1] < 2.2) || (p[0] > 3.2 && p[0] < 4.2 && p[1] > 3.5 && p[1] < 5);
    if (!(below && p[2] == 0)) seen.add(p, cloud.normals[i]);
  }
  const Found room = find_normals(seen);
  EXPECT_GT(compare(seen, room.normals).right_side, 0.99);
  EXPECT_GT(static_cast<double>(room.report.by_inside), 0.99 * static_cast<double>(seen.size()));
  // Without a thing in it it might as well be a box.
  const Found box = find_normals(empty);
  EXPECT_LT(compare(empty, box.normals).right_side, 0.01);
  EXPECT_EQ(box.report.by_outside, empty.size());
}

// Islands of hills, too far apart for links, some of them steep.
TEST(WithNormals, OfTerrainInPiecesFaceUp) {
  const auto hills = [](double x, double y) { return 0.12 * std::sin(14 * x) * std::cos(11 * y) + 0.1 * x; };
  Oriented whole;
  test::add_sheet(whole, 60000, hills);
  Oriented pieces;
  for (std::size_t i = 0; i < whole.size(); ++i) {
    const double x = 7 * whole.positions[i][0];
    const double y = 7 * whole.positions[i][1];
    if (x - std::floor(x) > 0.7 || y - std::floor(y) > 0.7) continue;
    pieces.add(whole.positions[i], whole.normals[i]);
  }
  const Found found = find_normals(pieces);
  EXPECT_GT(compare(pieces, found.normals).right_side, 0.999);
  EXPECT_EQ(found.report.by_up, pieces.size());
  EXPECT_GT(found.report.components, 20);
}

// Standing on its edge, so that nothing is level.
TEST(WithNormals, OfAThinClosedPlateFaceOut) {
  std::mt19937 random(6);
  Oriented cloud;
  Box{{0, 0, 0}, {0.04, 1, 1}, false, false}.scatter(cloud, 12000, random);
  const Found found = find_normals(cloud);
  EXPECT_GT(compare(cloud, found.normals).right_side, 0.98);
  EXPECT_EQ(found.report.unsure, 0);
}

// Four deviations of noise thick: there are samples all the way from one face to the other.
TEST(WithNormals, OfANoisyThinWallFaceOut) {
  std::mt19937 random(6);
  std::normal_distribution<> noise(0, 0.01);
  Oriented cloud;
  Box{{0, 0, 0}, {0.04, 1, 1}, false, false}.scatter(cloud, 12000, random);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const double d = noise(random);
    for (std::size_t a = 0; a < 3; ++a) cloud.positions[i][a] += d * cloud.normals[i][a];
  }
  const Found found = find_normals(cloud);
  EXPECT_GT(compare(cloud, found.normals).right_side, 0.95);
  EXPECT_EQ(found.report.unsure, 0);
}

// Noise of several spacings: neighbours lie one behind the other, and their links say that one of them must turn. Where
// links of half an agreement make patches, four samples of a thousand face in.
TEST(WithNormals, OfAVeryNoisyTorusFaceOut) {
  std::mt19937 random(6);
  std::normal_distribution<> noise(0, 0.06);
  Oriented cloud;
  test::add_torus(cloud, 40000);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const double d = noise(random);
    for (std::size_t a = 0; a < 3; ++a) cloud.positions[i][a] += d * cloud.normals[i][a];
  }
  const Found found = find_normals(cloud);
  EXPECT_GT(compare(cloud, found.normals).right_side, 0.998);
}

TEST(WithNormals, OfARealGroundFaceUp) {
  const std::string file = LAMINA_SOURCE_DIR "/../shared/data/las/autzen_trim_7.las";
  if (!std::filesystem::exists(file)) GTEST_SKIP() << "no " << file;
  NormalsSettings settings;
  settings.viewpoints = {{{0, 0, 1}, true}};
  NormalsReport report;
  const auto source = with_normals(open_points(file), settings, report, {});
  std::size_t up = 0;
  for (const Vector& n : test::normals_of(*source)) up += n[2] > 0.1 ? 1 : 0;
  EXPECT_GT(static_cast<double>(up), 0.9 * static_cast<double>(report.samples));
  EXPECT_LT(report.conflicts.share(), 0.01);
}

TEST(WithNormals, AreTheSameForAnyNumberOfThreads) {
  Oriented cloud;
  test::add_torus(cloud, 20000);
  const Found one = find_normals(cloud, {}, false, 1);
  const Found four = find_normals(cloud, {}, false, 4);
  EXPECT_EQ(one.normals, four.normals);
  EXPECT_EQ(one.report.conflicts.pairs, four.report.conflicts.pairs);
}

TEST(WithNormals, RefusesWhatCannotBe) {
  Oriented cloud;
  test::add_sphere(cloud, 100, 1);
  const auto refusal = [&](const NormalsSettings& s) {
    try {
      find_normals(cloud, s);
    } catch (const Error& e) {
      EXPECT_EQ(e.code(), ExitCode::usage);
      return std::string(e.what());
    }
    return std::string();
  };
  using ::testing::HasSubstr;
  EXPECT_THAT(refusal(in_mode(NormalsMode::check)), HasSubstr("no normals to check"));
  NormalsSettings s;
  s.k = 2;
  EXPECT_THAT(refusal(s), HasSubstr("--k"));
  s = {};
  s.radius = -1;
  EXPECT_THAT(refusal(s), HasSubstr("--radius"));
  s = {};
  s.viewpoints = {{{0, 0, 0}, true}};
  EXPECT_THAT(refusal(s), HasSubstr("up"));
}

TEST(WithNormals, RefusesMoreMemoryThanAllowed) {
  Oriented cloud;
  test::add_sphere(cloud, 3000, 1);
  NormalsReport report;
  RunContext run;
  run.max_memory = std::size_t{256} << 20;
  EXPECT_NO_THROW(
      lamina::with_normals(std::make_unique<test::OrientedSource>(cloud, false), NormalsSettings{}, report, run));
  run.max_memory = std::size_t{16} << 20;
  try {
    lamina::with_normals(std::make_unique<test::OrientedSource>(cloud, false), NormalsSettings{}, report, run);
    ADD_FAILURE() << "no error";
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ExitCode::budget);
    EXPECT_THAT(e.what(), ::testing::HasSubstr("--max-memory allows 17 MB"));
  }
}

}  // namespace
}  // namespace lamina
