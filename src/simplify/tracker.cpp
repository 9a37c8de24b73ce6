#include "simplify/tracker.h"

#include <algorithm>
#include <limits>

namespace lamina::simplify {
namespace {

using namespace meshes;

constexpr float kTightened = 0.8F;
constexpr double kUsed = 0.995;      ///< of the bound: the other way it is a little farther
constexpr float kSurelyNear = 0.3F;  ///< of what is left of the bound: root mean square of distances taken on trust
constexpr double kRimUsed = 0.6;     ///< of the bound: root mean square distance of a boundary vertex from the boundary

}  // namespace

Tracker::Tracker(const OldMesh& old)
    : old_(old),
      origin_(Extent(old).origin),
      near_old_(old),
      rims_(old.positions.size()),
      back_(old.triangles.size()),
      room_(old.triangles.size()),
      spare_(old.triangles.size()),
      under_(old.triangles.size()),
      homes_(old.triangles.size()) {
  for (std::uint32_t i = 0; i < old.triangles.size(); ++i) {
    back_[i] = old.errors[i].back;
    room_[i] = static_cast<float>(kUsed * old.bound);
    spare_[i] = static_cast<float>(old.bound) - std::max(old.errors[i].out, old.errors[i].back);
    under_[i] = homes_[i] = i;
    for (std::uint32_t k = 0; k < 3; ++k) {
      if (old.twins[3 * i + k] == kNone) add_rim(old.triangles[i][k], old.triangles[i][(k + 1) % 3]);
    }
  }
}

void Tracker::add_rim(std::uint32_t from, std::uint32_t to) {
  const Vec3 at = old_.positions[from] - origin_, edge = old_.positions[to] - old_.positions[from], along = unit(edge);
  const double weight = dot(edge, edge), d = dot(along, at);
  Quadric line;
  line.a = {weight * (1 - along[0] * along[0]), -weight * along[0] * along[1], -weight * along[0] * along[2],
            weight * (1 - along[1] * along[1]), -weight * along[1] * along[2], weight * (1 - along[2] * along[2])};
  line.b = weight * (at - d * along);
  line.c = weight * (dot(at, at) - d * d);
  rims_[from] += line;
  rims_[to] += line;
}

/// Is the place as near the boundary edges that both stand for?
bool Tracker::rim_allows(std::uint32_t u, std::uint32_t v, const Vec3& to) const {
  Quadric sum = rims_[u];
  sum += rims_[v];
  const double most = kRimUsed * old_.bound;
  return sum.weight() <= 0 || 2 * sum.at(to - origin_) <= sum.weight() * most * most;
}

bool Tracker::allows(const Stars& stars, std::span<const Vec3> positions, std::uint32_t u, std::uint32_t v,
                     const Vec3& to) {
  if (!rim_allows(u, v, to)) return false;
  after_.clear();
  uses_.clear();
  room_after_ = spare_after_ = static_cast<float>(kUsed * old_.bound);
  for (const std::uint32_t vertex : {u, v}) {
    for (const std::uint32_t triangle : stars.around(vertex)) {
      room_after_ = std::min(room_after_, room_[triangle]);
      spare_after_ = std::min(spare_after_, spare_[triangle]);
    }
  }
  for (const std::uint32_t vertex : {u, v}) {
    for (const std::uint32_t triangle : stars.around(vertex)) {
      const Triangle& t = stars.triangles()[triangle];
      if (names(t, vertex == u ? v : u)) continue;
      const std::size_t k = corner_of(t, vertex);
      const NearOld::Corners corners{to, positions[t[(k + 1) % 3]], positions[t[(k + 2) % 3]]};
      const auto most = static_cast<double>(room_after_);
      const NearOld::Answer answer = near_old_.look(corners, under_[triangle], most);
      if (answer == NearOld::Answer::far) return false;
      if (answer == NearOld::Answer::unclear && !near_old_.prove(corners, under_[triangle], most)) return false;
      const auto used = near_old_.used();
      uses_.insert(uses_.end(), used.begin(), used.end());
      after_.push_back({triangle, near_old_.begin(), near_old_.error(), static_cast<std::uint32_t>(uses_.size())});
    }
  }
  return true;
}

bool Tracker::takes_on_trust(const Stars& stars, std::uint32_t u, std::uint32_t v, double mean_square) {
  if (stars.boundary(u) || stars.boundary(v)) return false;
  float spare = std::numeric_limits<float>::infinity();
  for (const std::uint32_t vertex : {u, v}) {
    for (const std::uint32_t triangle : stars.around(vertex)) spare = std::min(spare, spare_[triangle]);
  }
  const auto most = static_cast<double>(kSurelyNear * spare);
  if (!(most > 0) || mean_square > most * most) return false;
  after_.clear();
  for (const std::uint32_t vertex : {u, v}) {
    for (const std::uint32_t triangle : stars.around(vertex)) {
      back_[triangle] = -1;
      spare_[triangle] = spare;
    }
  }
  return true;
}

void Tracker::accept(std::uint32_t u, std::uint32_t v) {
  rims_[u] += rims_[v];
  std::size_t use = 0;
  for (const After& after : after_) {
    back_[after.triangle] = after.back;
    room_[after.triangle] = room_after_;
    spare_[after.triangle] = spare_after_;
    under_[after.triangle] = after.under;
    for (; use < after.uses; ++use) homes_[uses_[use]] = after.triangle;
  }
}

void Tracker::undo(std::uint32_t u, std::uint32_t v) {
  Quadric less = rims_[v];
  for (double& a : less.a) a = -a;
  less.b = -1 * less.b;
  less.c = -less.c;
  rims_[u] += less;
}

void Tracker::tighten(std::uint32_t triangle) {
  room_[triangle] *= kTightened;
  spare_[triangle] = 0;
}

}  // namespace lamina::simplify
