// The scenes: what is scanned, from where, and what goes wrong.
#pragma once
#include <functional>
#include <ostream>
#include <string>
#include <vector>

#include "lamina/mesh.h"
#include "scenes/scanner.h"
#include "scenes/truths.h"

namespace lamina::test::scenes {

struct Scene {
  std::string name;
  std::function<TriangleMesh()> truth;
  std::vector<ScannerView> views;
  ScannerErrors errors;
  bool without_normals = false;
};
/// For GoogleTest.
inline void PrintTo(const Scene& scene, std::ostream* out) {
  *out << scene.name;
}

/// Three stations in the street; the nearest sees a part only.
inline std::vector<ScannerView> street_views(int resolution) {
  std::vector<ScannerView> views;
  for (const Vec3& eye : {Vec3{-3, 1.6, 9}, {2.5, 1.6, 5}, {5, 1.7, 10}})
    views.push_back(look_at(eye, {0, 2.5, 0}, {0, 1, 0}, 220 * resolution, 130 * resolution, 0.7));
  return views;
}

inline std::vector<ScannerView> views_from_above(int resolution) {
  std::vector<ScannerView> views;
  for (const Vec3& eye : {Vec3{-2, -1, 6}, {2, 1.2, 6}, {0.5, -2.5, 5}}) {
    const Vec3 target{0.7 * eye[0], 0.5 * eye[1], 0};
    views.push_back(look_at(eye, target, {0, 1, 0}, 170 * resolution, 130 * resolution, 0.6));
  }
  return views;
}

constexpr ScannerErrors kSlight{0.2, 0.2, 0, 0, 1}, kMild{0.3, 0.3, 0, 0, 1}, kStray{0.3, 0.2, 0.1, 0, 1},
    kBad{1, 1, 0.5, 0.005, 2}, kDusty{0.3, 0.3, 0, 0.08, 1}, kNoisy{3, 0.3, 0, 0, 1}, kUnsteady{1, 0.3, 0.1, 0, 1};

/// `resolution` multiplies the columns and rows of all images. The plate is two spacings thick at any.
inline std::vector<Scene> all_scenes(int resolution) {
  const std::vector<ScannerView> ball = views_around({}, 3.6, 6, 140 * resolution);
  const std::vector<ScannerView> inside{look_around({0.9, 1.4, 2.2}, 260 * resolution, 1.3),
                                        look_around({3.1, 1.5, 0.7}, 260 * resolution, 1.3)};
  const auto plate = [=] { return plate_truth(0.026 / resolution); };
  return {
      {"Knot", knot_truth, ball, kMild},
      {"KnotWithoutNormals", knot_truth, ball, kMild, true},
      {"KnotBadlyScanned", knot_truth, ball, kBad},
      {"KnotInDust", knot_truth, ball, kDusty},
      {"KnotInDustWithoutNormals", knot_truth, ball, kDusty, true},
      {"KnotVeryNoisy", knot_truth, ball, kNoisy},
      {"KnotFromOneSide", knot_truth, {ball[2]}, kStray},
      {"Facade", facade_truth, street_views(resolution), kStray},
      {"Room", room_truth, inside, kStray},
      {"RoomNoisyWithoutNormals", room_truth, inside, kUnsteady, true},
      {"ThinPlate", plate, views_around({}, 0.65, 6, 110 * resolution), kSlight},
      {"Terraces", terrain_truth, views_from_above(resolution), kMild},
  };
}

}  // namespace lamina::test::scenes
