#include "simplify/old_mesh.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace lamina::simplify {
namespace {

using namespace meshes;

constexpr int kCutsForEach = 8;           ///< facet
constexpr int kHalvings = 12;             ///< of a triangle near many
constexpr std::size_t kFewFacets = 40;    ///< that are asked at once
constexpr std::size_t kManyFacets = 300;  ///< around: a triangle near more is not asked about, which would take long
constexpr std::size_t kAnyAround = 24;    ///< a search goes so far in any direction

/// For Overlay.
struct OldView {
  const OldMesh& old;
  bool both_ways;
  [[nodiscard]] const Vec3& position(std::uint32_t v) const { return old.positions[v]; }
  [[nodiscard]] const Triangle& triangle(std::uint32_t t) const { return old.triangles[t].corners; }
  [[nodiscard]] std::uint32_t twin(std::uint32_t side) const { return old.triangles[side / 3].twins[side % 3]; }
  [[nodiscard]] double error(std::uint32_t t) const { return static_cast<double>(old.triangles[t].errors.back); }
  [[nodiscard]] double needs(std::uint32_t t) const {
    const Errors& e = old.triangles[t].errors;
    return static_cast<double>(both_ways ? std::max(e.back, e.out) : e.back);
  }
};

/// What lies within a distance of a triangle lies in it.
struct Box {
  Box(const std::array<Vec3, 3>& t, double distance) {
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] = std::min({t[0][k], t[1][k], t[2][k]}) - distance;
      high[k] = std::max({t[0][k], t[1][k], t[2][k]}) + distance;
    }
  }
  [[nodiscard]] bool meets(const Vec3& a, const Vec3& b, const Vec3& c) const {
    for (std::size_t k = 0; k < 3; ++k) {
      if (std::max({a[k], b[k], c[k]}) < low[k] || std::min({a[k], b[k], c[k]}) > high[k]) return false;
    }
    return true;
  }
  Vec3 low{}, high{};
};

/// kFewFacets of them.
void keep_nearest(const Vec3& place, double within, std::vector<const Facet*>& facets) {
  std::vector<std::pair<double, const Facet*>> by_distance;
  by_distance.reserve(facets.size());
  for (const Facet* facet : facets) by_distance.emplace_back(distance_within(place, *facet, within), facet);
  const auto nearer = [](const auto& a, const auto& b) {
    return a.first != b.first ? a.first < b.first : a.second->id < b.second->id;
  };
  std::nth_element(by_distance.begin(), by_distance.begin() + kFewFacets, by_distance.end(), nearer);
  facets.clear();
  for (std::size_t i = 0; i < kFewFacets; ++i) facets.push_back(by_distance[i].second);
}

}  // namespace

float no_less_than(double error) {
  const auto f = static_cast<float>(error);
  return static_cast<double>(f) >= error ? f : std::nextafter(f, std::numeric_limits<float>::infinity());
}

Extent::Extent(const OldMesh& old) {
  if (!old.positions.empty()) origin = old.positions[old.positions.size() / 2];
  for (const Vec3& p : old.positions) size = std::max(size, norm(p - origin));
  size += old.bound;
}

NearOld::NearOld(const OldMesh& old)
    : old_(old),
      extent_(old),
      overlay_(old.triangles.size()),
      cover_(old.bound, extent_.origin, extent_.size),
      facets_(old.triangles.size()),
      search_(old.triangles.size()) {}

NearOld::Answer NearOld::look(const Corners& triangle, std::uint32_t begin, double most) {
  const Answer answer = overlay_.prove(triangle, OldView{old_, true}, begin, most);
  error_ = answer == Answer::near ? no_less_than(overlay_.error()) : -1;
  return answer;
}

bool NearOld::prove(const Corners& triangle, std::uint32_t begin, double most) {
  const Answer answer = overlay_.prove(triangle, OldView{old_, false}, begin, most);
  error_ = no_less_than(overlay_.error());
  if (answer == Answer::near) return true;
  error_ = 0;
  for (const Vec3& corner : triangle) {
    if (norm(corner - extent_.origin) > extent_.size) return false;
  }
  if (answer == Answer::likely) {
    found_.clear();
    for (const std::uint32_t number : overlay_.used()) found_.push_back(facet(number));
    if (cover(triangle, found_, old_.bound - most, kHalvings)) return true;
    error_ = 0;
  }
  search(triangle, overlay_.begin());
  if (found_.size() > kManyFacets) return false;
  return cover(triangle, found_, old_.bound - most, kHalvings);
}

/// For old triangles that may be near, from one on to those beside it.
void NearOld::search(const Corners& triangle, std::uint32_t begin) {
  const Box box(triangle, old_.bound);
  found_.clear();
  queue_.assign(1, begin);
  search_[begin] = ++searches_;
  for (std::size_t next = 0; next < queue_.size() && found_.size() <= kManyFacets; ++next) {
    const std::uint32_t number = queue_[next];
    const Triangle& t = old_.triangles[number].corners;
    const bool meets = box.meets(old_.positions[t[0]], old_.positions[t[1]], old_.positions[t[2]]);
    if (meets) found_.push_back(facet(number));
    if (!meets && next > kAnyAround) continue;
    for (const std::uint32_t v : t) {
      for (const std::uint32_t other : old_.around(v)) {
        if (search_[other] == searches_) continue;
        search_[other] = searches_;
        queue_.push_back(other);
      }
    }
  }
}

const Facet* NearOld::facet(std::uint32_t number) {
  if (facets_[number] == nullptr) {
    const Triangle& t = old_.triangles[number].corners;
    Facet& facet = made_.emplace_back(
        make_facet(old_.positions[t[0]], old_.positions[t[1]], old_.positions[t[2]], extent_.origin));
    facet.error = static_cast<double>(old_.triangles[number].errors.back);
    facet.id = number;
    facets_[number] = &facet;
  }
  return facets_[number];
}

/// Where there are many facets the triangle is halved; one smaller than the bound asks those nearest to its middle.
bool NearOld::cover(const Corners& triangle, const std::vector<const Facet*>& all, double error, int halvings) {
  if (all.size() <= kFewFacets) {
    if (!cover_.prove(triangle, error, all, kCutsForEach * static_cast<int>(all.size()))) return false;
    error_ = std::max(error_, no_less_than(cover_.error() - error));
    return true;
  }
  const Box box(triangle, old_.bound);
  std::vector<const Facet*> near;
  for (const Facet* facet : all) {
    if (box.meets(facet->corners[0], facet->corners[1], facet->corners[2])) near.push_back(facet);
  }
  std::size_t longest = 0;
  const auto length = [&](std::size_t i) { return norm(triangle[(i + 1) % 3] - triangle[i]); };
  for (std::size_t k = 1; k < 3; ++k) {
    if (length(k) > length(longest)) longest = k;
  }
  if (near.size() > kFewFacets && (halvings == 0 || length(longest) < old_.bound))
    keep_nearest(1. / 3 * (triangle[0] + triangle[1] + triangle[2]), old_.bound, near);
  if (near.size() <= kFewFacets) return cover(triangle, near, error, halvings);
  const Vec3 &a = triangle[longest], &b = triangle[(longest + 1) % 3], &c = triangle[(longest + 2) % 3];
  const Vec3 middle = 0.5 * (a + b);
  return cover({a, middle, c}, near, error, halvings - 1) && cover({middle, b, c}, near, error, halvings - 1);
}

}  // namespace lamina::simplify
