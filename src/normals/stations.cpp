#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <utility>
#include <vector>

#include "meshes/vec3.h"
#include "normals/sides.h"

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

/// The cosine at which a wall is seen, below 0 from behind; 0 where it is not.
double cosine_from(const Vec3& place, const Occupancy& around, const Wall& wall) {
  const Vec3 towards = wall.at - place;
  const double distance = norm(towards);
  const double cosine = -dot(wall.facing, towards) / distance;
  if (!(std::abs(cosine) > kGrazingCosine)) return 0;
  constexpr double kNear = 2.5;  // cubes: the wall's own, and those beside it
  return around.way(place, (1 / distance) * towards) > distance - kNear ? cosine : 0;
}

using Seen = std::vector<std::uint8_t>;

double area_added(const Seen& here, const Seen& known, const std::vector<Wall>& walls) {
  double added = 0;
  for (std::size_t i = 0; i < walls.size(); ++i) added += here[i] != 0 && known[i] == 0 ? walls[i].area : 0;
  return added;
}

}  // namespace

std::vector<Vec3> places_within(const Occupancy& around, const std::vector<Wall>& walls) {
  std::vector<Vec3> places;
  for (std::size_t w = 0; w < walls.size(); w += walls.size() / kPlaces + 1) {
    const Vec3 from = walls[w].at + Occupancy::kClear * walls[w].facing;
    const double way = around.way(from, walls[w].facing);
    if (way < around.diagonal()) places.push_back(from + 0.5 * way * walls[w].facing);
  }
  return places;
}

double share_seen_within(const Occupancy& around, const std::vector<Wall>& all_walls) {
  if (all_walls.size() < kLeastWalls) return 0;
  const std::vector<Wall> walls = some_of(all_walls);
  double all = 0;
  for (const Wall& wall : walls) all += wall.area;
  std::vector<Seen> seen;
  for (const Vec3& place : places_within(around, walls)) {
    seen.emplace_back(walls.size());
    for (std::size_t i = 0; i < walls.size(); ++i) seen.back()[i] = cosine_from(place, around, walls[i]) > 0 ? 1 : 0;
  }
  double sum = 0;
  Seen known(walls.size(), 0);
  for (int s = 0; s < kStations; ++s) {
    double most = 0;
    const Seen* best = nullptr;
    for (const Seen& here : seen) {
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

namespace {

/// Walls by the cube that they lie in, to look for those that stand close before others.
class NearWalls {
 public:
  explicit NearWalls(const std::vector<Wall>& walls) : walls_(walls) {
    for (std::uint32_t i = 0; i < walls.size(); ++i) order_.push_back({key(cube_of(walls[i].at)), i});
    tbb::parallel_sort(order_.begin(), order_.end());
  }

  /// Whether another wall, as near as Occupancy tells no walls apart, hides this one from a place.
  [[nodiscard]] bool hide(const Wall& wall, const Vec3& place) const {
    const Vec3 direction = meshes::unit(place - wall.at);
    const Cube middle = cube_of(wall.at);
    for (int x = -kReach; x <= kReach; ++x) {
      for (int y = -kReach; y <= kReach; ++y) {
        const std::uint64_t first = key({middle[0] + x, middle[1] + y, middle[2] - kReach});
        auto at = std::lower_bound(order_.begin(), order_.end(), std::pair{first, std::uint32_t{0}});
        for (; at != order_.end() && at->first <= first + 2 * kReach; ++at)
          if (stands_before(walls_[at->second], wall, direction)) return true;
      }
    }
    return false;
  }

 private:
  static constexpr int kReach = 2;  ///< cubes
  using Cube = std::array<int, 3>;
  static Cube cube_of(const Vec3& at) { return {int(at[0]), int(at[1]), int(at[2])}; }
  static std::uint64_t key(const Cube& c) {
    const auto part = [](int v) { return static_cast<std::uint64_t>(v + kReach); };
    return part(c[0]) << 42 | part(c[1]) << 21 | part(c[2]);
  }
  /// A patch as a disk of its area.
  static bool stands_before(const Wall& other, const Wall& wall, const Vec3& direction) {
    constexpr double kApart = 0.1;  // cubes: less is noise
    const Vec3 offset = other.at - wall.at;
    double before = dot(offset, other.facing);
    double cosine = dot(direction, other.facing);
    if (cosine < 0) {
      before = -before;
      cosine = -cosine;
    }
    if (before < kApart || cosine < kGrazingCosine) return false;
    const Vec3 miss = offset - (before / cosine) * direction;
    return dot(miss, miss) * std::numbers::pi < other.area;
  }

  const std::vector<Wall>& walls_;
  std::vector<std::pair<std::uint64_t, std::uint32_t>> order_;
};

}  // namespace

namespace {

/// Whether something hides a patch from a place that lies farther before it than what may be its own surface. Not told
/// in corners, where one cannot step back so far.
bool is_hidden(const Wall& patch, const Vec3& place, const Occupancy& around) {
  const double side = dot(patch.facing, place - patch.at) > 0 ? Occupancy::kClear : -Occupancy::kClear;
  const Vec3 from = patch.at + side * patch.facing;
  const double distance = norm(place - from);
  const double way = distance > 0 ? around.way(from, (1 / distance) * (place - from)) : 0;
  return way > 0 && way < distance;
}

}  // namespace

std::vector<double> votes_from_within(const Occupancy& around, const std::vector<Vec3>& places,
                                      const std::vector<Wall>& patches) {
  constexpr double kOneSided = 0.8;  // of what all see that see it: nine tenths from one side
  const NearWalls near(patches);
  std::vector<double> votes(patches.size(), 0);
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, patches.size(), 64), [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) {
      double sum = 0;
      double all = 0;
      for (const Vec3& place : places) {
        const double cosine = cosine_from(place, around, patches[i]);
        if (cosine == 0 || is_hidden(patches[i], place, around) || near.hide(patches[i], place)) continue;
        sum += cosine;
        all += std::abs(cosine);
      }
      if (std::abs(sum) > kOneSided * all) votes[i] = sum / all;
    }
  });
  return votes;
}

}  // namespace lamina::normals
