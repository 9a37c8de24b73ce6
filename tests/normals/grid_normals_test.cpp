// Normals by the faces of an organised scan's grid, against what was scanned.
#include "normals/row_normals.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <optional>

#include "base/temporary_folder.h"
#include "normals/clouds.h"

namespace lamina::normals {
namespace {

using test::dot;
using test::Oriented;
using test::Vector;

/// Where a ray from the origin meets a sphere before a wall, and the normal there; nothing above the wall.
struct Hit {
  Vector at{}, normal{};
};

std::optional<Hit> shoot(const Vector& ray) {
  const Vector centre{4, 0, 0};
  const double along = dot(ray, centre);
  const double inside = 1 - (dot(centre, centre) - along * along);
  if (inside > 0) {
    const double t = along - std::sqrt(inside);
    const Vector p{t * ray[0], t * ray[1], t * ray[2]};
    return Hit{p, {p[0] - centre[0], p[1], p[2]}};
  }
  const double t = 6 / ray[0];
  if (t * ray[2] > 2) return {};
  return Hit{{6, t * ray[1], t * ray[2]}, {-1, 0, 0}};
}

struct Scan {
  Oriented truth;
  std::shared_ptr<ScanGrid> grid = std::make_shared<ScanGrid>(kAcross);
  static constexpr std::size_t kAcross = 110;
};

/// A picture of the scene from the origin; every seventeenth place is blind.
Scan scan() {
  Scan s;
  for (int line = 0; line < 100; ++line) {
    for (int at = 0; at < static_cast<int>(Scan::kAcross); ++at) {
      const double turn = 0.008 * (at - 55);
      const double rise = 0.008 * (line - 50);
      const Vector ray{std::cos(rise) * std::cos(turn), std::cos(rise) * std::sin(turn), std::sin(rise)};
      const bool blind = (at + 7 * line) % 17 == 0;
      const auto hit = blind ? std::nullopt : shoot(ray);
      s.grid->add(hit.has_value());
      if (hit) s.truth.add(hit->at, hit->normal);
    }
  }
  return s;
}

struct Agreement {
  double found = 0, near = 0, right_side = 0;  ///< shares; near: within 15 degrees of the truth
};

Agreement compare(PointSource& source, const Oriented& truth) {
  SampleBatch rows;
  source.read(0, truth.size(), rows);
  Agreement a;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const Vector n{rows.nx[i], rows.ny[i], rows.nz[i]};
    if (dot(n, n) == 0) continue;
    EXPECT_NEAR(dot(n, n), 1, 1e-5);
    ++a.found;
    const double cosine = dot(n, truth.normals[i]);
    a.near += cosine > std::cos(15 * std::numbers::pi / 180) ? 1 : 0;
    a.right_side += cosine > 0 ? 1 : 0;
  }
  a.near /= a.found;
  a.right_side /= a.found;
  a.found /= static_cast<double>(truth.size());
  return a;
}

TEST(GridNormals, FaceTheScannerOnASphereBeforeAWall) {
  const Scan s = scan();
  const std::vector<SeenFrom> origin{{0, true, {}}};
  const GridNormals found =
      grid_normals(std::make_unique<test::OrientedSource>(s.truth, false), {{0, s.grid}}, origin, "/tmp", {});
  const Agreement a = compare(*found.source, s.truth);
  EXPECT_GT(a.found, 0.9);
  EXPECT_GT(a.near, 0.995);
  EXPECT_EQ(a.right_side, 1);
  EXPECT_NEAR(static_cast<double>(found.found), a.found * static_cast<double>(s.truth.size()), 0.5);
}

TEST(GridNormals, NothingWithoutAScannerOrBesideTheGrid) {
  Scan s = scan();
  const std::uint64_t in_grid = s.truth.size();
  for (int i = 0; i < 50; ++i) s.truth.add({1, 0.01 * i, 0}, {-1, 0, 0});
  const auto source = [&] { return std::make_unique<test::OrientedSource>(s.truth, false); };
  EXPECT_EQ(grid_normals(source(), {{0, s.grid}}, {{0, false, {}}}, "/tmp", {}).found, 0u);
  const GridNormals found = grid_normals(source(), {{0, s.grid}}, {{0, true, {}}}, "/tmp", {});
  SampleBatch rows;
  found.source->read(in_grid, 50, rows);
  ASSERT_EQ(rows.size(), 50u);
  for (std::size_t i = 0; i < rows.size(); ++i) EXPECT_EQ(rows.nx[i], 0);
}

/// What the grid leaves open, the nearest samples say.
TEST(GridNormals, ThroughTheWholeSearch) {
  const Scan s = scan();
  Oriented truth = s.truth;
  truth.scans = {{0, ScanPart::Scanner::position, {0, 0, 0}}};
  NormalsReport report;
  const auto found = with_normals(organised_points(std::make_unique<test::OrientedSource>(truth, false), s.grid),
                                  NormalsSettings{}, report);
  const Agreement a = compare(*found, truth);
  EXPECT_EQ(a.found, 1);
  EXPECT_GT(a.near, 0.99);
  EXPECT_EQ(a.right_side, 1);
  EXPECT_EQ(report.estimated, truth.size());
  EXPECT_EQ(report.by_viewpoint, truth.size());
}

/// The scan as a part of a PTX file, in a pose that makes it `scale` times as large, mirrors x where it is negative,
/// and moves it; lines end as on other systems. Adds to the truth.
std::string ptx_of(const Scan& s, double scale, const Vector& shift, Oriented& truth) {
  const double size = std::abs(scale);
  std::string text = fmt::format("{}\r\n{}\r\n0 0 0\r\n1 0 0\r\n0 1 0\r\n0 0 1\r\n", s.grid->lines(), Scan::kAcross);
  text += fmt::format("{} 0 0 0\r\n0 {} 0 0\r\n0 0 {} 0\r\n{} {} {} 1\r\n", scale, size, size, shift[0], shift[1],
                      shift[2]);
  std::size_t row = 0;
  for (std::uint64_t line = 0; line < s.grid->lines(); ++line) {
    for (std::size_t at = 0; at < Scan::kAcross; ++at) {
      if (!s.grid->has(line, at)) {
        text += "0 0 0 0.5 0 0 0\r\n";
        continue;
      }
      const Vector& p = s.truth.positions[row];
      const Vector& n = s.truth.normals[row++];
      text += fmt::format("{} {} {} 0.25 200 100 50\r\n", p[0], p[1], p[2]);
      truth.add({scale * p[0] + shift[0], size * p[1] + shift[1], size * p[2] + shift[2]},
                {scale < 0 ? -n[0] : n[0], n[1], n[2]});
    }
  }
  return text;
}

TEST(GridNormals, OfAPtxFileWithSeveralPoses) {
  const Scan s = scan();
  const test::TemporaryFolder folder;
  Oriented truth;
  std::string text = ptx_of(s, 1, {0, 0, 0}, truth);
  text += ptx_of(s, -0.5, {100, 0, 0}, truth);
  NormalsReport report;
  const auto found = with_normals(open_points(test::write_file(folder / "scans.ptx", text)), NormalsSettings{}, report);
  EXPECT_EQ(report.by_viewpoint, truth.size());
  ASSERT_EQ(found->info().count, truth.size());
  EXPECT_EQ(found->info().attributes.size(), 4U);
  const Agreement a = compare(*found, truth);
  EXPECT_EQ(a.found, 1);
  EXPECT_GT(a.near, 0.99);
  EXPECT_EQ(a.right_side, 1);
}

}  // namespace
}  // namespace lamina::normals
