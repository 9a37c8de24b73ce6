#include "normals/sides.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>

#include "meshes/vec3.h"
#include "normals/directions.h"
#include "normals/sample_window.h"

namespace lamina::normals {
namespace {

using meshes::dot;
using meshes::norm;
using meshes::operator*;
using meshes::to_double;
using meshes::Vec3;

constexpr double kOpen = 0.3;     ///< openness: half a sphere has 0.5
constexpr double kTight = 0.1;    ///< likewise: hardly a gap
constexpr double kSheet = 0.5;    ///< likewise: hills and valleys have more
constexpr double kLevel = 0.75;   ///< cosine
constexpr double kUpright = 0.5;  ///< cosine
constexpr double kClear = 0.1;    ///< share of the area that makes a majority clear

/// The area that counts for what is seen: strays stand for more than they are.
double area_of(const PatchNode& node, float cell) {
  constexpr double kMost = 2;
  return std::min(double{node.area}, kMost * double{cell} * double{cell});
}

/// What sight says for a patch's front, -1..1: it is the side from which one sees farther, if the other is closed.
double preference(const Sight& s) {
  if (s.front.is_closed() != s.back.is_closed()) return s.back.is_closed() ? 1 : -1;
  if (!s.front.is_closed()) return 0;
  constexpr double kHalf = 0.5;
  const double both = double{s.front.way} + double{s.back.way};
  return both > 0 ? kHalf * (double{s.front.way} - double{s.back.way}) / both : 0;
}

bool is_shut_in(const View& view, const View& other) {
  constexpr float kFarther = 1.2F;
  return view.is_closed() && other.way > kFarther * view.way;
}

/// How much a patch's front faces up, -1..1.
double upwardness(const PatchNode& node, const Vec3& up) {
  return node.area == 0 ? 0 : dot(to_double(node.outward), up) / double{node.area};
}

/// Of a patch that faces up, or down, by so much.
bool is_open_above(const Sight& s, double upward) {
  constexpr float kHalf = 0.5F;
  return (upward > 0 ? s.front : s.back).open >= kHalf;
}

/// The direction across a cloud much wider than it is high; towards the positive side of the input axis next to it.
std::optional<Vec3> flat_across(const PatchGraph& graph, const InputAxes& axes) {
  constexpr double kFlat = 0.25;  // of the variance along the shorter side
  constexpr double kWide = 0.02;
  Moments m;
  for (const PatchNode& node : graph.nodes) {
    if (node.count < Occupancy::kLeastCount) continue;
    m.add(node.centre, area_of(node, graph.cell) / (double{graph.cell} * double{graph.cell}));
  }
  const Plane plane = fit_plane(m);
  if (!plane.valid() || plane.least > kFlat * plane.middle || plane.middle < kWide * plane.most) return {};
  const Vec3 normal = to_double(plane.normal);
  double along = 0;
  for (const std::array<float, 3>& axis : {axes[2], axes[1], axes[0]}) {
    const double cosine = dot(normal, to_double(axis));
    if (std::abs(cosine) > std::abs(along)) along = cosine;
  }
  return along < 0 ? -1.0 * normal : normal;
}

}  // namespace

double Body::openness() const {
  return norm(facing) / area;
}

bool Body::encloses() const {
  constexpr double kLittle = 0.1;  // of the volume that the same area could enclose
  // Thin, but with both faces and a rim all around.
  constexpr double kShut = 0.05;
  constexpr double kThin = 0.005;
  return openness() <= kOpen && std::abs(volume) > (openness() <= kShut ? kThin : kLittle) * size;
}

bool Body::is_sheet(const Vec3& across) const {
  return openness() > kSheet && std::abs(dot(facing, across)) > kLevel * norm(facing);
}

bool is_inside_out(const Body& body) {
  return body.volume < 0;
}

Sides::Sides(const PatchGraph& graph, const InputAxes& axes, std::vector<float> looks)
    : graph_(graph),
      around_(graph),
      looks_(std::move(looks)),
      sights_(look_around(graph, around_, looks_)),
      up_(to_double(axes[2])) {
  if (!(graph.cell > 0)) return;
  flat_ = flat_across(graph, axes);
  is_level_ = flat_ && dot(*flat_, up_) > kLevel;
}

std::vector<Body> Sides::bodies(const std::vector<std::uint32_t>& root, const std::vector<std::int8_t>& sign) const {
  const std::size_t n = graph_.nodes.size();
  std::vector<Body> bodies(n);
  for (std::size_t i = 1; i < n; ++i) {
    const PatchNode& node = graph_.nodes[i];
    Body& body = bodies[root[i]];
    body.area += double{node.area};
    body.samples += node.count;
    for (std::size_t a = 0; a < 3; ++a) {
      body.moment[a] += double{node.area} * double{node.centre[a]};
      body.facing[a] += sign[i] * double{node.outward[a]};
    }
    const double area = area_of(node, graph_.cell);
    body.counted += area;
    const double looked = double{looks_[i]} * area;
    body.seen += looked * sign[i] * preference(sights_[i]);
    const double up = upwardness(node, up_);
    body.skyward += is_open_above(sights_[i], up) ? looked * sign[i] * up : 0;
    const bool in = is_shut_in(sights_[i].front, sights_[i].back);
    const bool out = is_shut_in(sights_[i].back, sights_[i].front);
    ((sign[i] > 0) ? body.shut_in : body.shut_out) += in ? looked : 0;
    ((sign[i] > 0) ? body.shut_out : body.shut_in) += out ? looked : 0;
  }
  for (std::size_t i = 1; i < n; ++i) {
    const PatchNode& node = graph_.nodes[i];
    Body& body = bodies[root[i]];
    Vec3 offset{};
    for (std::size_t a = 0; a < 3; ++a) offset[a] = double{node.centre[a]} - body.moment[a] / body.area;
    body.volume += sign[i] * (dot(to_double(node.outward), offset) + double{node.bulge});
    body.size += double{node.area} * norm(offset);
  }
  return bodies;
}

std::optional<std::uint32_t> Sides::find_room(const std::vector<Body>& bodies, const std::vector<std::uint32_t>& root,
                                              const std::vector<std::int8_t>& sign) const {
  std::optional<std::uint32_t> widest;
  for (std::uint32_t i = 1; i < bodies.size(); ++i) {
    if (root[i] != i || root[i] == kFixed || !bodies[i].encloses()) continue;
    if (!widest || std::abs(bodies[i].volume) > std::abs(bodies[*widest].volume)) widest = i;
  }
  if (!widest) return {};
  // Turned outside out, what part of it would face into a dead end?
  const Body& body = bodies[*widest];
  double all = 0;
  for (const Body& other : bodies) all += other.counted;
  constexpr double kMost = 0.5;  // of the cloud
  if (body.counted < kMost * all) return {};
  double hidden = is_inside_out(body) ? body.shut_out : body.shut_in;
  double area = 0;
  for (std::uint32_t i = 1; i < bodies.size(); ++i) {
    constexpr double kSealed = 0.05;  // openness: what a scanner sees of a thing always has gaps
    const bool own = root[i] == *widest;
    const double here = area_of(graph_.nodes[i], graph_.cell);
    if (own) area += here;
    if (own || root[i] == kFixed || (bodies[root[i]].encloses() && bodies[root[i]].openness() < kSealed)) continue;
    if (sights_[i].front.is_closed() && sights_[i].back.is_closed()) hidden += double{looks_[i]} * here;
  }
  constexpr double kMuch = 0.0125;
  if (hidden < kMuch * area) return {};
  constexpr double kSeen = 0.89;
  return share_seen_within(around_, walls_of(body, *widest, root, sign)) > kSeen ? widest : std::nullopt;
}

std::optional<Wall> Sides::wall_of(std::uint32_t patch) const {
  constexpr double kFlat = 0.5;  // of its area
  const PatchNode& node = graph_.nodes[patch];
  const Vec3 outward = to_double(node.outward);
  const double length = norm(outward);
  if (!(length > kFlat * double{node.area})) return {};
  return Wall{around_.place(node), (1 / length) * outward,
              area_of(node, graph_.cell) / (around_.side() * around_.side())};
}

std::vector<Wall> Sides::walls_of(const Body& body, std::uint32_t body_root, const std::vector<std::uint32_t>& root,
                                  const std::vector<std::int8_t>& sign) const {
  const double inward = is_inside_out(body) ? 1 : -1;
  std::vector<Wall> walls;
  for (std::uint32_t i = 1; i < root.size(); ++i) {
    if (root[i] != body_root) continue;
    std::optional<Wall> wall = wall_of(i);
    if (!wall) continue;
    wall->facing = inward * sign[i] * wall->facing;
    walls.push_back(*wall);
  }
  return walls;
}

std::vector<float> Sides::votes_from_within(const Body& room, std::uint32_t room_root,
                                            const std::vector<std::uint32_t>& root,
                                            const std::vector<std::int8_t>& sign) const {
  std::vector<Wall> walls;
  std::vector<std::uint32_t> patches;
  for (std::uint32_t i = 1; i < root.size(); ++i) {
    if (root[i] == kFixed) continue;
    if (const std::optional<Wall> wall = wall_of(i)) {
      walls.push_back(*wall);
      patches.push_back(i);
    }
  }
  const std::vector<Vec3> places = places_within(around_, walls_of(room, room_root, root, sign));
  const std::vector<double> seen_from = normals::votes_from_within(around_, places, walls);
  std::vector<float> votes(root.size(), 0);
  for (std::size_t w = 0; w < walls.size(); ++w)
    votes[patches[w]] = static_cast<float>(seen_from[w] * graph_.nodes[patches[w]].count);
  return votes;
}

bool Sides::seen_from_above(const std::vector<Body>& bodies, const std::vector<std::uint32_t>& root) const {
  if (!is_level_) return false;
  double cloud = 0;
  double ground = 0;
  for (std::uint32_t i = 0; i < bodies.size(); ++i) {
    if (root[i] != i) continue;
    cloud += bodies[i].counted;
    ground += i != kFixed && bodies[i].is_sheet(up_) ? bodies[i].counted : 0;
  }
  constexpr double kMost = 0.5;
  if (ground <= kMost * cloud) return false;
  double all = 0;
  double flat = 0;
  double open = 0;
  for (std::size_t i = 1; i < graph_.nodes.size(); ++i) {
    const PatchNode& node = graph_.nodes[i];
    if (looks_[i] == 0 || node.count < Occupancy::kLeastCount) continue;
    const double area = double{looks_[i]} * area_of(node, graph_.cell);
    const double up = upwardness(node, up_);
    const bool steep = std::abs(up) < kUpright;
    all += area;
    flat += steep ? 0 : area;
    open += !steep && is_open_above(sights_[i], up) ? area : 0;
  }
  constexpr double kMostWalls = 0.2;  // who stands on the ground sees more of them
  constexpr double kBare = 0.5;       // floors lie below ceilings
  return flat > (1 - kMostWalls) * all && open > kBare * flat;
}

std::vector<float> Sides::votes_from_above(const std::vector<std::uint32_t>& root) const {
  std::vector<float> votes(root.size(), 0);
  for (std::size_t i = 1; i < root.size(); ++i) {
    if (root[i] != kFixed)
      votes[i] = static_cast<float>(kFromFar * upwardness(graph_.nodes[i], up_) * graph_.nodes[i].count);
  }
  return votes;
}

Side Sides::choose(const Body& body) const {
  const double facing = norm(body.facing);
  const double openness = body.openness();
  const double upward = dot(body.facing, up_);
  const SignSource level = is_level_ ? SignSource::up : SignSource::unsure;
  // Ground lies open above, whatever stands on it.
  if (body.is_sheet(up_)) return {upward < 0, level};
  if (body.encloses() && openness < kTight) return {is_inside_out(body), SignSource::outside};
  // Whatever was not seen from within faces the sky where that is open above.
  if (std::abs(body.skyward) > kClear * body.counted)
    return {body.skyward < 0, is_level_ ? SignSource::up : SignSource::sight};
  if (body.encloses()) return {is_inside_out(body), SignSource::outside};
  if (std::abs(body.seen) > kClear * body.counted) return {body.seen < 0, SignSource::sight};
  if (openness > kOpen) {
    if (std::abs(upward) > kUpright * facing) return {upward < 0, level};
    const double across = flat_ ? dot(body.facing, *flat_) : 0;
    if (std::abs(across) > kUpright * facing) return {across < 0, SignSource::unsure};
  }
  return {is_inside_out(body), SignSource::unsure};
}

}  // namespace lamina::normals
