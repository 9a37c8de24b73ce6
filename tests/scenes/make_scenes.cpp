// Scans the scenes of the tests with sixteen times their samples, for scripts/paper-tables: lamina_scenes FOLDER
// [DRAGON] DRAGON, a mesh, is scanned like the knot. Writes scan_NAME.ply, gt_NAME.ply, seen_NAME.ply and
// scan_NAME.json each.
#include <cstdio>
#include <exception>
#include <fstream>
#include <string>
#include <vector>

#include "lamina/mesh.h"
#include "measure/triangle_bvh.h"
#include "scatter/point_rows.h"
#include "scenes/scanner.h"
#include "scenes/scenes.h"

namespace {

using namespace lamina;
using namespace lamina::test::scenes;

constexpr int kResolution = 4;
constexpr std::size_t kPlaces = 800000;

void write_points(const std::string& path, const std::vector<Vec3>& positions, const std::vector<Vec3>& normals) {
  const scatter_detail::RowLayout layout;
  scatter_detail::RowPacker rows(layout);
  for (std::size_t i = 0; i < positions.size(); ++i) rows.add(positions[i], normals[i], {});
  std::ofstream out(path, std::ios::binary);
  out << scatter_detail::ply_header(layout, positions.size()) << rows.bytes();
}

void write_points(const std::string& path, const std::vector<Vec3>& positions) {
  TriangleMesh points;
  points.positions = positions;
  write_mesh(points, path);
}

void make(const Scene& scene, const std::string& folder) {
  const TriangleMesh truth = scene.truth();
  const SceneScan scan = SceneScanner(truth, scene.views, scene.errors).scan(kPlaces);
  const auto file = [&](const std::string& kind, const std::string& end) {
    return folder + "/" + kind + "_" + scene.name + end;
  };
  write_mesh(truth, file("gt", ".ply"));
  if (scene.without_normals)
    write_points(file("scan", ".ply"), scan.cloud.positions);
  else
    write_points(file("scan", ".ply"), scan.cloud.positions, scan.cloud.normals);
  write_points(file("seen", ".ply"), scan.seen);
  std::ofstream(file("scan", ".json")) << "{\"px\": " << scan.spacing << ", \"points\": " << scan.cloud.size() << "}\n";
  std::printf("%s: %zu points\n", scene.name.c_str(), scan.cloud.size());
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2 || argc > 3) {
    std::fputs("usage: lamina_scenes FOLDER [DRAGON]\n", stderr);
    return 2;
  }
  try {
    std::vector<Scene> scenes = all_scenes(kResolution);
    if (argc > 2) {
      const TriangleMesh dragon = read_mesh(argv[2]);
      const measure::Bounds box = measure::triangle_bounds(dragon);
      const std::vector<ScannerView> views =
          views_around(0.5 * (box.low + box.high), 0.5 * norm(box.high - box.low), 8, 175 * kResolution);
      scenes.push_back({"Dragon", [=] { return dragon; }, views, kMild});
      scenes.push_back({"DragonBadlyScanned", [=] { return dragon; }, views, kBad});
    }
    for (const Scene& scene : scenes) make(scene, argv[1]);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "lamina_scenes: %s\n", e.what());
    return 1;
  }
  return 0;
}
