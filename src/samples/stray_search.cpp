#include "samples/stray_search.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "base/vectors.h"

namespace lamina {
namespace {

constexpr std::size_t kLookedAt = Surroundings::kLookedAt;

/// Whether a place cannot be lonely, whatever strays are found: told without a search around each of its neighbours.
/// Half of these have their own no nearer than loneliness asks for. That is known of those that have been searched
/// around. Of the others it follows from what is in the ball that the neighbours fill, where nothing else lies, and
/// from how far they are from its edge.
bool is_in_company(const Placed& s, const Surroundings& known, std::size_t place) {
  if (known.count[place] < kLookedAt) return false;
  const std::uint32_t* const neighbours = known.neighbours_of(place);
  std::array<std::array<float, kLookedAt>, 3> from{};  // the place
  std::array<float, kLookedAt> away{};
  for (std::size_t k = 0; k < kLookedAt; ++k) {
    from[0][k] = static_cast<float>(s.x[neighbours[k]] - s.x[place]);
    from[1][k] = static_cast<float>(s.y[neighbours[k]] - s.y[place]);
    from[2][k] = static_cast<float>(s.z[neighbours[k]] - s.z[place]);
    away[k] = std::sqrt(from[0][k] * from[0][k] + from[1][k] * from[1][k] + from[2][k] * from[2][k]);
  }
  constexpr float kSlack = 1 + 1e-3F;
  const float least = kSlack / kLonely * known.distance[place];
  std::size_t close = 0;  // neighbours that may have theirs nearer
  for (std::size_t n = 0; n < kStrayNeighbours; ++n) {
    if (n - close >= kStrayNeighbours / 2) return true;
    if (const float its = known.distance[neighbours[n]]; its >= 0) {
      if (its < least && ++close > kStrayNeighbours / 2) return false;
      continue;
    }
    const float to_edge = away.back() - away[n];
    float sum = std::min(away[n], to_edge);  // to the place and to the others
    for (std::size_t k = 0; k < kLookedAt; ++k) {
      const float dx = from[0][k] - from[0][n];
      const float dy = from[1][k] - from[1][n];
      const float dz = from[2][k] - from[2][n];
      sum += std::min(std::sqrt(dx * dx + dy * dy + dz * dz), to_edge);
    }
    sum -= static_cast<float>(kLookedAt - kStrayNeighbours) * to_edge;  // not the farthest ones
    if (sum < static_cast<float>(kStrayNeighbours) * least && ++close > kStrayNeighbours / 2) return false;
  }
  return close <= kStrayNeighbours / 2;
}

}  // namespace

Company company_of(const Surroundings& known, std::size_t place) {
  Company out;
  for (std::size_t k = 0; k < known.count[place] && out.count < kStrayNeighbours; ++k) {
    const std::uint32_t n = known.neighbours_of(place)[k];
    if (known.stray[n] == kStays) out.places[out.count++] = n;
  }
  return out;
}

float mean_distance(const Placed& s, std::size_t place, const Company& company, float reach) {
  float sum = static_cast<float>(kStrayNeighbours - company.count) * reach;  // those not found are at least there
  for (std::size_t k = 0; k < company.count; ++k) {
    const std::size_t n = company.places[k];
    const auto dx = static_cast<float>(s.x[n] - s.x[place]);
    const auto dy = static_cast<float>(s.y[n] - s.y[place]);
    const auto dz = static_cast<float>(s.z[n] - s.z[place]);
    sum += std::sqrt(dx * dx + dy * dy + dz * dz);
  }
  return sum / static_cast<float>(kStrayNeighbours);
}

template <class Each>
void Search::for_suspects(const Each& each) {
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, around_.samples().size(), 4096), [&](const auto& range) {
    for (std::size_t p = range.begin(); p < range.end(); ++p) {
      if (out_.suspect[p] != kClear) each(p);
    }
  });
}

void Search::search_wanted() {
  auto rows = static_cast<std::uint32_t>(out_.neighbours.size() / kLookedAt);
  for (std::size_t p = 0; p < out_.look.size(); ++p) {
    if (out_.look[p] == kWanted) out_.row[p] = rows++;
  }
  out_.neighbours.resize(std::size_t{rows} * kLookedAt);
  const std::vector<SampleLeaf>& leaves = around_.leaves();
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, leaves.size(), 256), [&](const auto& range) {
    for (std::size_t leaf = range.begin(); leaf < range.end(); ++leaf) search_leaf(leaves[leaf]);
  });
}

void Search::search_leaf(const SampleLeaf& leaf) {
  std::array<std::uint32_t, Neighbourhoods::kMostInLeaf> places;
  std::size_t n = 0;
  for (std::size_t p = leaf.begin; p < leaf.end; ++p) {
    if (out_.look[p] == kWanted) places[n++] = static_cast<std::uint32_t>(p);
  }
  if (n == 0) return;
  std::array<Neighbourhoods::Nearest, Neighbourhoods::kMostInLeaf> found;
  around_.find_nearest({places.data(), n}, found.data());
  for (std::size_t i = 0; i < n; ++i) {
    const std::uint32_t p = places[i];
    out_.count[p] = static_cast<std::uint8_t>(found[i].count);
    std::copy_n(found[i].places.begin(), found[i].count, &out_.neighbours[std::size_t{out_.row[p]} * kLookedAt]);
    out_.look[p] = kDone;
  }
}

void Search::search_around() {
  for (std::size_t p = 0; p < around_.samples().size(); ++p) {
    if (out_.suspect[p] != kToCompare) continue;
    for (std::size_t k = 0; k < out_.count[p]; ++k) {
      std::uint8_t& look = out_.look[out_.neighbours_of(p)[k]];
      if (look == kNot) look = kWanted;
    }
  }
  search_wanted();
}

void Search::start() {
  const Placed& samples = around_.samples();
  const std::size_t places = samples.size();
  out_.neighbours.clear();
  resize_anew(out_.row, places);
  out_.count.assign(places, 0);
  out_.stray.assign(places, kStays);
  out_.suspect.assign(places, kClear);
  out_.look.assign(places, kNot);
  for (std::size_t p = 0; p < places; ++p) {
    if (!around_.is_doubtful(p) || !around_.is_near(p, reach_)) continue;
    out_.look[p] = kWanted;
    out_.suspect[p] = kToCompare;
  }
  search_wanted();
  out_.beside.assign(places, 0);
  out_.distance.assign(places, -1);
  for_suspects([&](std::size_t p) {
    if (out_.count[p] > 0) out_.distance[p] = mean_distance(samples, p, company_of(out_, p), reach_);
  });
  for_suspects([&](std::size_t p) {
    if (is_in_company(samples, out_, p)) out_.suspect[p] = kInCompany;
    if (out_.count[p] < kStrayNeighbours) out_.beside[p] = around_.count_within_twice(p) >= kManyBeside ? 1 : 0;
  });
  search_around();
}

void Search::go_on() {
  for_suspects([&](std::size_t p) {
    if (!around_.is_own(p)) return;
    for (std::size_t k = 0; k < out_.count[p]; ++k) {
      if (out_.stray[out_.neighbours_of(p)[k]] != kStays) out_.suspect[p] = kToCompare;
    }
  });
  search_around();
}

}  // namespace lamina
