// Scanned scenes, and how good the mesh is that comes of them without any option.
#include <gtest/gtest.h>

#include <functional>
#include <iostream>
#include <map>
#include <ostream>
#include <string>
#include <vector>

#include "base/temporary_folder.h"
#include "lamina/mesh.h"
#include "lamina/surface.h"
#include "points/ply_files.h"
#include "reconstruct/clouds.h"
#include "scenes/mesh_quality.h"
#include "scenes/scanner.h"
#include "scenes/truths.h"

namespace lamina {
namespace {

using namespace test::scenes;

// What the program reaches, with a margin. Less is better in every column.
// clang-format off
const std::map<std::string, MeshQuality> kLimits{
  //                       error missing invented layers flipped normals parts flakes folds loops ragged turn coincident
  {"Knot",               {  0.21,   0.05,    0.1,  1.05,    0.4,     20,    4,   0.1,  1.2,   15,   1.5,   66,   0}},
  {"KnotWithoutNormals", {  0.21,   0.05,    0.1,  1.05,    0.4,     20,    4,   0.1,  1.2,   15,   1.6,   72,   3}},
  {"KnotBadlyScanned",   { 19,      0.2,    44,    1.3,    28,       80,  370,   8,    9,    330,   1.8,  104,  40}},
  {"KnotFromOneSide",    {  3.1,    0.3,    22,    1.0,    18,       78,   27,   2.6,  9,     21,   1.5,   82,   6}},
  {"Facade",             {  0.46,   0.1,     6.6,  0.96,    4.4,     75,  145,   2.2,  3.3,  145,   1.6,   68,  20}},
  {"Room",               {  0.35,   1.1,     1.1,  1.06,    1.6,     48,   55,   0.6,  1.4,   62,   1.6,   73,   5}},
  {"ThinPlate",          {  0.165,  0,       0,    1.05,    0.2,     43,    6,   0.2,  0.2,    3,   1,      0,   0}},
  {"Terraces",           {  0.28,   0.05,    0.2,  1.08,    3.1,     61,   13,   0.2,  1.9,   30,   1.5,   58,   5}},
};
// clang-format on

struct Scene {
  std::string name;
  std::function<TriangleMesh()> truth;
  std::vector<ScannerView> views;
  ScannerErrors errors;
  bool without_normals = false;
};
void PrintTo(const Scene& scene, std::ostream* out) {
  *out << scene.name;
}

std::vector<ScannerView> street_views() {
  std::vector<ScannerView> views;
  for (const Vec3& eye : {Vec3{-3, 1.6, 9}, {2.5, 1.6, 5}, {5, 1.7, 10}})
    views.push_back(look_at(eye, {0, 2.5, 0}, {0, 1, 0}, 220, 130, 0.7));
  return views;
}

std::vector<ScannerView> views_from_above() {
  std::vector<ScannerView> views;
  for (const Vec3& eye : {Vec3{-2, -1, 6}, {2, 1.2, 6}, {0.5, -2.5, 5}})
    views.push_back(look_at(eye, {0.7 * eye[0], 0.5 * eye[1], 0}, {0, 1, 0}, 170, 130, 0.6));
  return views;
}

std::vector<Scene> scenes() {
  const ScannerErrors mild{.noise = 0.3, .misregistration = 0.3}, bad{1, 1, 0.5, 0.005, 2}, stray{0.3, 0.2, 0.1, 0, 1},
      slight{.noise = 0.2, .misregistration = 0.2};
  const std::vector<ScannerView> ball = views_around(3.6, 6, 140);
  const std::vector<ScannerView> inside{look_around({0.9, 1.4, 2.2}, 260, 1.3), look_around({3.1, 1.5, 0.7}, 260, 1.3)};
  const auto plate = [] { return plate_truth(0.026); };
  return {
      {"Knot", knot_truth, ball, mild},
      {"KnotWithoutNormals", knot_truth, ball, mild, true},
      {"KnotBadlyScanned", knot_truth, ball, bad},
      {"KnotFromOneSide", knot_truth, {ball[2]}, stray},
      {"Facade", facade_truth, street_views(), stray},
      {"Room", room_truth, inside, stray},
      {"ThinPlate", plate, views_around(0.65, 6, 110), slight},
      {"Terraces", terrain_truth, views_from_above(), mild},
  };
}

class ScannedScene : public ::testing::TestWithParam<Scene> {};
INSTANTIATE_TEST_SUITE_P(Surface, ScannedScene, ::testing::ValuesIn(scenes()),
                         [](const auto& scene) { return scene.param.name; });

std::string write_points(const test::Cloud& cloud, bool with_normals, const std::string& path) {
  test::PlyModel model = test::ply_model(cloud);
  if (!with_normals) {
    auto& vertices = model.elements[0];
    vertices.columns.resize(3);
    for (auto& row : vertices.cells) row.resize(3);
  }
  return test::write_file(path, test::ply_bytes(model, PlyFormat::little_endian));
}

TEST_P(ScannedScene, KeepsItsLimits) {
  const Scene& scene = GetParam();
  const TriangleMesh truth = scene.truth();
  const SceneScan scan = SceneScanner(truth, scene.views, scene.errors).scan();
  const test::TemporaryFolder folder;
  SurfaceSettings settings;
  if (scene.without_normals) settings.normals = NormalsChoice::automatic;
  settings.input = write_points(scan.cloud, !scene.without_normals, folder / "in.ply");
  settings.output = folder / "out.ply";
  reconstruct_surface(settings, {});
  const MeshQuality q = judge_mesh(read_mesh(settings.output), truth, scan);
  std::cout << scan.cloud.size() << " samples: " << q << '\n';

  const MeshQuality& limits = kLimits.at(scene.name);
  EXPECT_LE(q.error, limits.error);
  EXPECT_LE(q.missing, limits.missing);
  EXPECT_LE(q.invented, limits.invented);
  EXPECT_LE(q.layers, limits.layers);
  EXPECT_LE(q.flipped, limits.flipped);
  EXPECT_LE(q.normals, limits.normals);
  EXPECT_LE(q.parts, limits.parts);
  EXPECT_LE(q.flakes, limits.flakes);
  EXPECT_LE(q.folds, limits.folds);
  EXPECT_LE(q.loops, limits.loops);
  EXPECT_LE(q.ragged, limits.ragged);
  EXPECT_LE(q.turn, limits.turn);
  EXPECT_LE(q.coincident, limits.coincident);
}

}  // namespace
}  // namespace lamina
