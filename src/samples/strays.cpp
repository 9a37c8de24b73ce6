#include "samples/cleaning.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "base/vectors.h"
#include "lamina/error.h"
#include "samples/neighbourhoods.h"
#include "samples/sampling_survey.h"

namespace lamina {
namespace {

constexpr std::uint64_t kSurveyed = 1u << 16;  ///< samples the spacing is taken from
/// How far neighbours are looked for, in median density radii (two spacings each).
constexpr double kStrayReach = 6;
/// Neighbours looked for, so that enough are left when some of them are strays.
constexpr std::size_t kLookedAt = Neighbourhoods::kNeighbours;
/// Most samples are on a surface beyond doubt, and a dozen of them together tell so without a search: their mean normal
/// is so long, each lies within this cosine of it, none is farther from their middle than so many times (squared) the
/// usual, and none farther from their plane than this share (squared) of it.
constexpr float kPlainAgreement = 0.9F;
constexpr float kPlainCosine = 0.6F;
constexpr float kPlainSpread = 4;
constexpr float kPlainThickness = 0.25F;
/// Fewer lie on one plane by chance.
constexpr std::size_t kLeastPlain = 6;

/// What is known of the places of a slab.
struct Surroundings {
  std::vector<float> distance;            ///< mean distance to the neighbours; negative: not looked at
  std::vector<std::uint32_t> neighbours;  ///< kLookedAt for each place searched around, nearest first
  std::vector<std::uint32_t> row;         ///< of the place in `neighbours`
  std::vector<std::uint8_t> count;        ///< of them
  std::vector<std::uint8_t> stray;        ///< Verdict
  std::vector<std::uint8_t> suspect;      ///< Suspicion
  std::vector<std::uint8_t> look;         ///< Search's
  std::vector<std::uint8_t> beside;       ///< 1: few neighbours, but many samples not much farther away

  /// Of a place that has been searched around: `count` of them.
  [[nodiscard]] const std::uint32_t* neighbours_of(std::size_t place) const {
    return neighbours.data() + std::size_t{row[place]} * kLookedAt;
  }
};

enum Verdict : std::uint8_t { kStays, kIsLonely, kIsOffSurface };

enum Suspicion : std::uint8_t {
  kClear,      ///< no stray
  kInCompany,  ///< perhaps off all surfaces, but not lonely
  kCompared,   ///< perhaps either: its neighbours' own have to be known
};

/// The neighbours of a place that have not been found to be strays.
struct Company {
  std::array<std::uint32_t, kStrayNeighbours> places;
  std::size_t count = 0;
};

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

/// Whether fewer than `least` of the company lie on the surface of a sample, and too few exactly.
bool is_off_surface(const Placed& s, std::size_t place, const Company& company, float least) {
  if (company.count == 0) return true;
  std::array<float, kStrayNeighbours> off;
  float farthest2 = 0;
  for (std::size_t i = 0; i < company.count; ++i) {
    const std::size_t n = company.places[i];
    const auto dx = static_cast<float>(s.x[n] - s.x[place]);
    const auto dy = static_cast<float>(s.y[n] - s.y[place]);
    const auto dz = static_cast<float>(s.z[n] - s.z[place]);
    off[i] = std::abs(dx * s.nx[place] + dy * s.ny[place] + dz * s.nz[place]);
    farthest2 = std::max(farthest2, dx * dx + dy * dy + dz * dz);
  }
  const float limit = kNearPlane * std::sqrt(farthest2);
  const float exact_limit = kOnPlane * std::sqrt(farthest2);
  std::size_t exact = 0;
  std::size_t along = 0;  // its surface, facing its way
  std::size_t against = 0;
  std::array<float, 3> mean{};  // of all neighbours' normals
  for (std::size_t i = 0; i < company.count; ++i) {
    const std::size_t n = company.places[i];
    const float cosine = s.nx[n] * s.nx[place] + s.ny[n] * s.ny[place] + s.nz[n] * s.nz[place];
    exact += off[i] <= exact_limit && cosine > kSameWay ? 1 : 0;
    along += off[i] <= limit && cosine > kAlongSurface ? 1 : 0;
    against += off[i] <= limit && cosine < -kAlongSurface ? 1 : 0;
    mean[0] += s.nx[n];
    mean[1] += s.ny[n];
    mean[2] += s.nz[n];
  }
  const auto all = static_cast<float>(company.count);
  const float agreement = std::sqrt(mean[0] * mean[0] + mean[1] * mean[1] + mean[2] * mean[2]) / all;
  // Neighbours that do not agree among themselves say nothing of the way a sample faces.
  if (agreement < kAgreeing) along += against;
  return static_cast<float>(along) < least * all && static_cast<float>(exact) < kLeastExact * all;
}

/// Which samples of a leaf may be strays: none where they lie close together on one plane and face its way; where some
/// lie far from the others on that plane, those; else all.
void find_doubtful(const Placed& s, const SampleLeaf& leaf, std::uint8_t* doubtful) {
  std::fill_n(doubtful, leaf.size(), std::uint8_t{1});
  if (leaf.size() < kLeastPlain) return;
  const auto count = static_cast<float>(leaf.size());
  std::array<float, 3> middle{};
  std::array<float, 3> normal{};
  const auto at = [&](std::size_t i) {
    return std::array<float, 3>{static_cast<float>(s.x[i] - s.x[leaf.begin]),
                                static_cast<float>(s.y[i] - s.y[leaf.begin]),
                                static_cast<float>(s.z[i] - s.z[leaf.begin])};
  };
  for (std::size_t i = leaf.begin; i < leaf.end; ++i) {
    const std::array<float, 3> p = at(i);
    for (std::size_t k = 0; k < 3; ++k) middle[k] += p[k] / count;
    normal[0] += s.nx[i] / count;
    normal[1] += s.ny[i] / count;
    normal[2] += s.nz[i] / count;
  }
  const float length = std::sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]);
  if (length < kPlainAgreement) return;
  std::array<float, Neighbourhoods::kMostInLeaf> away{};
  float sum2 = 0;
  float thickest = 0;
  for (std::size_t i = leaf.begin; i < leaf.end; ++i) {
    const std::array<float, 3> p = at(i);
    float d2 = 0;
    float off = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const float d = p[k] - middle[k];
      d2 += d * d;
      off += d * normal[k];
    }
    if (s.nx[i] * normal[0] + s.ny[i] * normal[1] + s.nz[i] * normal[2] < kPlainCosine * length) return;
    away[i - leaf.begin] = d2;
    sum2 += d2;
    thickest = std::max(thickest, std::abs(off));
  }
  const float mean2 = sum2 / count;
  if (thickest * thickest > kPlainThickness * mean2 * length * length) return;
  for (std::size_t i = 0; i < leaf.size(); ++i) doubtful[i] = away[i] > kPlainSpread * mean2 ? 1 : 0;
}

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

/// Finds the neighbours of a slab's places as they are asked for.
class Search {
 public:
  Search(const Neighbourhoods& around, float reach, Surroundings& out) : around_(around), reach_(reach), out_(out) {}

  /// Of those that may be strays within reach of the slab, and of the neighbours that these are compared with.
  void start();
  /// And of those that places with strays among their neighbours are compared with.
  void go_on();

 private:
  enum Look : std::uint8_t { kNot, kWanted, kDone };

  template <class Each>
  void for_suspects(const Each& each) {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, around_.samples().size(), 4096), [&](const auto& range) {
      for (std::size_t p = range.begin(); p < range.end(); ++p) {
        if (out_.suspect[p] != kClear) each(p);
      }
    });
  }
  void search_wanted();
  void search_leaf(const SampleLeaf& leaf);
  /// Around the places compared with their neighbours.
  void search_around();

  const Neighbourhoods& around_;
  float reach_;
  Surroundings& out_;
};

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
    if (out_.suspect[p] != kCompared) continue;
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
    out_.suspect[p] = kCompared;
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
      if (out_.stray[out_.neighbours_of(p)[k]] != kStays) out_.suspect[p] = kCompared;
    }
  });
  search_around();
}

/// The median of the distances of its company; 0 where it has none.
float usual_distance(const Surroundings& known, const Company& company) {
  std::array<float, kStrayNeighbours> distances;
  std::size_t n = 0;
  for (std::size_t k = 0; k < company.count; ++k) {
    const float d = known.distance[company.places[k]];
    if (d >= 0) distances[n++] = d;
  }
  if (n == 0) return 0;
  const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(n / 2);
  std::nth_element(distances.begin(), middle, distances.begin() + static_cast<std::ptrdiff_t>(n));
  return *middle;
}

/// Judges the suspects within `margin` of the slab by what stays around them.
void judge_places(const Neighbourhoods& around, float reach, float margin, Surroundings& known) {
  const Placed& samples = around.samples();
  const auto for_places = [&](const auto& each) {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, samples.size(), 4096), [&](const auto& range) {
      for (std::size_t p = range.begin(); p < range.end(); ++p) {
        if (known.stray[p] == kStays) each(p);
      }
    });
  };
  known.distance.assign(samples.size(), -1);
  for_places([&](std::size_t p) {
    if (known.count[p] > 0) known.distance[p] = mean_distance(samples, p, company_of(known, p), reach);
  });
  std::vector<std::uint8_t> verdicts = known.stray;
  for_places([&](std::size_t p) {
    if (known.suspect[p] == kClear || !around.is_near(p, margin)) return;
    const Company company = company_of(known, p);
    const bool compared = known.suspect[p] == kCompared;
    if (compared && (known.distance[p] < 0 || known.distance[p] > kLonely * usual_distance(known, company))) {
      verdicts[p] = kIsLonely;
    } else if (known.beside[p] != 0 && company.count < kStrayNeighbours) {
      if (company.count < kLeastCompany || is_off_surface(samples, p, company, kLeastOnSparseSurface))
        verdicts[p] = kIsOffSurface;
    } else if (is_off_surface(samples, p, company, kLeastOnSurface)) {
      verdicts[p] = kIsOffSurface;
    }
  });
  known.stray = std::move(verdicts);
}

}  // namespace

StrayCounts drop_strays(const SlabStore& store, KeepMasks& masks, const RunContext& run, Reasons* reasons) {
  const RadiusSurvey radii = survey_density(store, kSurveyed);
  constexpr double kMostReach = 1 << 27;
  const auto reach = static_cast<float>(std::clamp(kStrayReach * double{radii.median}, 1.0, kMostReach));
  StrayCounts counts;
  const KeepMasks before = masks;
  Neighbourhoods around(store, before, reach, find_doubtful);
  Surroundings known;
  while (around.advance()) {
    if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
    Search search(around, reach, known);
    search.start();
    judge_places(around, reach, reach, known);
    // Strays keep each other company: those left are judged again without the others.
    search.go_on();
    judge_places(around, reach, 0, known);
    for (std::size_t p = 0; p < around.samples().size(); ++p) {
      if (!around.is_own(p) || known.stray[p] == kStays) continue;
      const std::uint32_t b = around.samples().bucket[p];
      const std::uint32_t number = around.samples().number[p];
      masks[b][number] = false;
      const bool lonely = known.stray[p] == kIsLonely;
      ++(lonely ? counts.lonely : counts.off_surface);
      if (reasons == nullptr) continue;
      std::vector<std::uint8_t>& bucket = (*reasons)[b];
      bucket.resize(store.count(b), 0);
      bucket[number] = lonely ? kReasonLonely : kReasonOffSurface;
    }
  }
  return counts;
}

}  // namespace lamina
