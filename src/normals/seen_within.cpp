#include "normals/seen_within.h"

#include <cstddef>
#include <cstdint>

namespace lamina::normals {
namespace {

using meshes::dot;
using meshes::norm;
using meshes::Vec3;
using meshes::operator+;
using meshes::operator-;
using meshes::operator*;

constexpr std::size_t kLeastWalls = 500;
constexpr std::size_t kMostWalls = 2048;  ///< that are looked at
constexpr std::size_t kPlaces = 128;      ///< that are tried
constexpr int kStations = 4;
constexpr double kGrazingCosine = 0.1;

/// Every so many, evenly.
std::vector<Wall> some_of(const std::vector<Wall>& walls) {
  std::vector<Wall> some;
  for (std::size_t i = 0; i < walls.size(); i += walls.size() / kMostWalls + 1) some.push_back(walls[i]);
  return some;
}

using Seen = std::vector<std::uint8_t>;

Seen seen_from(const Vec3& place, const Occupancy& around, const std::vector<Wall>& walls) {
  Seen seen(walls.size(), 0);
  for (std::size_t i = 0; i < walls.size(); ++i) {
    const Vec3 towards = walls[i].at - place;
    const double distance = norm(towards);
    if (!(dot(walls[i].facing, towards) < -kGrazingCosine * distance)) continue;
    constexpr double kNear = 2.5;  // cubes: the wall's own, and those beside it
    seen[i] = around.way(place, (1 / distance) * towards) > distance - kNear ? 1 : 0;
  }
  return seen;
}

double area_added(const Seen& here, const Seen& known, const std::vector<Wall>& walls) {
  double added = 0;
  for (std::size_t i = 0; i < walls.size(); ++i) added += here[i] != 0 && known[i] == 0 ? walls[i].area : 0;
  return added;
}

}  // namespace

double share_seen_within(const Occupancy& around, const std::vector<Wall>& all_walls) {
  if (all_walls.size() < kLeastWalls) return 0;
  const std::vector<Wall> walls = some_of(all_walls);
  double all = 0;
  for (const Wall& wall : walls) all += wall.area;
  std::vector<Seen> places;
  for (std::size_t w = 0; w < walls.size(); w += walls.size() / kPlaces + 1) {
    const Vec3 from = walls[w].at + Occupancy::kClear * walls[w].facing;
    const double way = around.way(from, walls[w].facing);
    // Half way to what lies opposite.
    if (way < around.diagonal()) places.push_back(seen_from(from + 0.5 * way * walls[w].facing, around, walls));
  }
  double sum = 0;
  Seen known(walls.size(), 0);
  for (int s = 0; s < kStations; ++s) {
    double most = 0;
    const Seen* best = nullptr;
    for (const Seen& here : places) {
      const double added = area_added(here, known, walls);
      if (added <= most) continue;
      most = added;
      best = &here;
    }
    if (best == nullptr) break;
    for (std::size_t i = 0; i < walls.size(); ++i) known[i] = known[i] != 0 || (*best)[i] != 0 ? 1 : 0;
    sum += most;
  }
  return all > 0 ? sum / all : 0;
}

}  // namespace lamina::normals
