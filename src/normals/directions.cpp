#include "normals/directions.h"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <vector>

#include "base/four.h"
#include "normals/edges.h"
#include "samples/nearest_search.h"

namespace lamina::normals {
namespace {

constexpr double kLine = 1.0 / 32;  ///< a smaller share of the middle variance in the largest is a line's

/// Neighbours at even steps of the list: the nearest ones alone may lie on one scan line, or at one place.
void link(const Neighbour* found, std::size_t count, std::uint32_t place, std::size_t i, Links& links) {
  auto& neighbours = links.neighbours[i];
  neighbours.fill(place);
  const std::size_t n = std::min(count, Links::kMost);
  for (std::size_t l = 0; l < n; ++l) neighbours[l] = found[(l + 1) * count / n - 1].sample;
  links.scale[i] = count > 0 ? found[count - 1].squared : 0.0F;
}

bool is_line(const Plane& plane) {
  return !plane.valid() || plane.middle < kLine * plane.most;
}

// Lines of samples that lie far apart, as a profile scanner's do. The nearest samples all lie in the scanner's plane
// then, and where the noise along its rays is as large as their spacing they fill a disc of it.
constexpr double kGrowth = 3;  ///< samples within twice the distance, on a surface: there are four times as many
constexpr std::size_t kMostOnLines = 2048;  ///< samples: lines so much farther apart than samples make no surface

/// Samples around one that lie on several lines, nearest first, and their plane.
struct AcrossLines {
  std::vector<Neighbour> near;
  Plane plane;
};

/// Goes on from the nearest samples, so many and so far away (steps^2), to where there are as many as on a surface.
/// Returns how often the distance was doubled for it; 0 where that is nowhere within `bound` (steps^2).
int look_across(const SampleTree& tree, std::uint32_t place, std::size_t count, float squared, float bound,
                AcrossLines& out) {
  if (!(squared > 0)) return 0;  // all of them at one place
  for (int doubled = 1; squared < bound && count < kMostOnLines; ++doubled) {
    squared = std::min(4 * squared, bound);
    out.near.clear();
    Moments m;
    m.count = 1;
    tree.fours_within({place, -1, squared}, [&](const SampleTree::FourSamples& four) {
      for (std::size_t i = 0; i < 4; ++i) {
        const auto other = static_cast<std::uint32_t>(four.places[i]);
        if (!(four.squared[i] <= squared) || other == place) continue;
        m.add({four.offset[0][i], four.offset[1][i], four.offset[2][i]});
        out.near.push_back({four.squared[i], other});
      }
    });
    const bool grows = static_cast<double>(out.near.size()) > kGrowth * static_cast<double>(count);
    count = out.near.size();
    if (!grows) continue;
    out.plane = fit_plane(m);
    if (is_line(out.plane)) continue;
    std::sort(out.near.begin(), out.near.end());
    return doubled;
  }
  return 0;
}

/// Of samples outside the slab, and of those whose normals are given.
constexpr std::uint8_t kNoLevel = 255;

class DirectionFinder {
 public:
  DirectionFinder(const SampleTree& tree, const DirectionSettings& settings, WindowSamples& samples, Links& links)
      : tree_(tree),
        settings_(settings),
        bound_(settings.search_radius * settings.search_radius),
        samples_(samples),
        links_(links),
        first_{std::vector<float>(samples.size(), -1.0F), std::vector<float>(links.core.size(), 0.0F)},
        level_(samples.size(), kNoLevel) {
    links_.neighbours.resize(links.core.size());
    links_.scale.resize(links.core.size());
  }

  void run() {
    tbb::parallel_for(blocks_of_core(), [&](const auto& range) {
      NearestSearch nearest(tree_);
      std::array<Around, NearestSearch::kAtOnce> some;
      for (std::size_t i = range.begin(); i < range.end(); i += some.size()) {
        const std::size_t n = std::min(some.size(), range.end() - i);
        nearest.start(std::span(links_.core).subspan(i, n), wanted_at_first(), bound_);
        for (std::size_t k = 0; k < n; ++k) finish_nearest(links_.core[i + k], nearest, k, some[k]);
        for (std::size_t k = 0; k < n; k += 2) {
          const std::array<Plane, 2> planes = fit_planes({some[k].moments, some[k + 1].moments});
          for (std::size_t one = k; one < std::min(k + 2, n); ++one) search(i + one, some[one], planes[one - k]);
        }
      }
    });
    // Noise is no matter of single samples: levels that neighbours do not share are chance.
    const std::vector<std::uint8_t> chosen = level_;
    for_core([&](std::size_t i) { settle(i, chosen); });
    sharpen_edges(tree_, first_, links_, samples_);
  }

 private:
  template <class Work>
  void for_core(const Work& work) {
    tbb::parallel_for(blocks_of_core(), [&](const auto& range) {
      for (std::size_t i = range.begin(); i < range.end(); ++i) work(i);
    });
  }
  [[nodiscard]] tbb::blocked_range<std::size_t> blocks_of_core() const { return {0, links_.core.size(), 512}; }

  /// The nearest samples around one.
  struct Around {
    std::array<Neighbour, SampleTree::kMostNeighbours> found;
    std::size_t count = 0;
    Moments moments;  ///< of those that its plane is fitted to
  };
  [[nodiscard]] std::size_t wanted_at_first() const {
    return std::max(static_cast<std::size_t>(settings_.k), kLeastLinked);
  }
  void finish_nearest(std::uint32_t place, NearestSearch& nearest, std::size_t k, Around& out) const {
    out.count = nearest.finish(k, out.found.data());
    const std::size_t taken = std::min(out.count, static_cast<std::size_t>(settings_.k));
    out.moments = moments_around(tree_, place, {out.found.data(), taken});
  }

  void search(std::size_t i, Around& around, Plane plane) {
    const std::uint32_t place = links_.core[i];
    auto& [found, count, moments] = around;
    std::size_t wanted = wanted_at_first();
    std::size_t taken = std::min(count, static_cast<std::size_t>(settings_.k));
    const std::size_t most = std::min(4 * wanted, SampleTree::kMostNeighbours);
    while (is_line(plane) && count == wanted && wanted < most) {
      wanted = std::min(2 * wanted, most);
      taken = count = tree_.nearest(place, wanted, bound_, found.data());
      plane = fit_plane(moments_around(tree_, place, {found.data(), count}));
    }
    float squared = taken > 0 ? found[taken - 1].squared : 0.0F;
    AcrossLines& across = across_.local();
    const bool line = is_line(plane) && count == most;
    // Samples that lie on a surface as near as that are not asked to look farther.
    const int least = line ? 1 : 2;
    if ((line || settings_.lines) && taken > 0 && look_across(tree_, place, taken, squared, bound_, across) >= least) {
      plane = across.plane;
      taken = across.near.size();
      squared = across.near.back().squared;
      link(across.near.data(), taken, place, i, links_);
    } else {
      link(found.data(), count, place, i, links_);
    }
    if (samples_.given[place] != 0) return;
    if (settings_.radius > 0) {
      plane = plane_of_ball(place, plane);
    } else if (taken > 0) {
      first_.reach[i] = plane.valid() ? squared : 0.0F;
      first_.variance[place] = plane.valid() ? static_cast<float>(plane.least) : -1.0F;
      level_[place] = choose_level(tree_, {place, plane, static_cast<double>(taken + 1), first_.reach[i], bound_});
    }
    set_normal(place, plane);
  }

  /// Too few within the radius: the nearest ones will do.
  [[nodiscard]] Plane plane_of_ball(std::uint32_t place, const Plane& nearest) const {
    const Plane wide = fit_plane(BallMoments(tree_, place).grow_to(settings_.radius * settings_.radius));
    return is_line(wide) ? nearest : wide;
  }

  /// The median of the sample's level and its neighbours'.
  void settle(std::size_t i, const std::vector<std::uint8_t>& chosen) {
    const float reach = first_.reach[i];
    if (reach == 0) return;
    const std::uint32_t place = links_.core[i];
    std::array<std::uint8_t, Links::kMost + 1> levels;
    levels.fill(chosen[place]);
    for (std::size_t l = 0; l < Links::kMost; ++l) {
      const std::uint8_t level = chosen[links_.neighbours[i][l]];
      if (level != kNoLevel) levels[l] = level;
    }
    std::nth_element(levels.begin(), levels.begin() + Links::kMost / 2, levels.end());
    const std::uint8_t level = levels[Links::kMost / 2];
    if (level == 0) return;
    const float squared = std::min(reach_of_level(reach, level), bound_);
    const Plane plane = plane_within(tree_, place, squared);
    if (!plane.valid()) return;
    set_normal(place, plane);
    samples_.lift[place] = height_of_sheet(tree_, place, plane.normal, {squared, reach});
  }

  void set_normal(std::uint32_t place, const Plane& plane) {
    samples_.nx[place] = plane.normal[0];
    samples_.ny[place] = plane.normal[1];
    samples_.nz[place] = plane.normal[2];
  }

  const SampleTree& tree_;
  const DirectionSettings& settings_;
  float bound_;
  WindowSamples& samples_;
  Links& links_;
  FirstPlanes first_;
  std::vector<std::uint8_t> level_;  ///< by place
  tbb::enumerable_thread_specific<AcrossLines> across_;
};

}  // namespace

void find_directions(const SampleTree& tree, const DirectionSettings& settings, WindowSamples& samples, Links& links) {
  DirectionFinder(tree, settings, samples, links).run();
}

namespace {

constexpr double kDegree = 0.017453292519943295;
constexpr double kUncertain = 2.5 * kDegree;  ///< first planes that are more certain than this stay
constexpr double kCertain = 1.5 * kDegree;    ///< goal
constexpr double kDeviations = 3.5;           ///< that two planes of one surface may differ by
constexpr double kSlack = 1 * kDegree;        ///< and besides
constexpr double kNoisy = 0.25;  ///< ratio of variances from which on the samples are a ball rather than a sheet
constexpr double kSteady = 1.2;  ///< growth of the residual, per level, that noise alone may show; an edge doubles it
constexpr double kMostSamples = 1024;
constexpr double kSlim = 0.6;  ///< ratio of variances along a sheet: ridges and spines are slimmer

/// Variance of a plane's tilt, radians^2: noise in the plane's own samples.
double tilt_variance(const Plane& plane, double samples) {
  const double gap = std::max(plane.middle - plane.least, 1e-6 * plane.most);
  return plane.least * plane.middle / (samples * gap * gap);
}

struct Estimate {
  Plane plane;
  double tilt = 0;
};

bool agree(const Estimate& a, const Estimate& b, double deviations2) {
  double cosine = 0;
  for (std::size_t i = 0; i < 3; ++i) cosine += double{a.plane.normal[i]} * double{b.plane.normal[i]};
  return 1 - cosine * cosine <= deviations2 * (a.tilt + b.tilt) + kSlack * kSlack;
}

/// Few samples of an even sheet may look slim.
bool is_slim(const Plane& plane, double samples) {
  return plane.middle < kSlim * (1 - 2 / std::sqrt(samples)) * plane.most;
}

}  // namespace

std::uint8_t choose_level(const SampleTree& tree, const FirstFit& first) {
  std::array<Estimate, kMostLevel + 1> estimates;
  estimates[0] = {first.plane, tilt_variance(first.plane, first.samples)};
  if (!first.plane.valid() || estimates[0].tilt <= kUncertain * kUncertain) return 0;
  BallMoments around(tree, first.place);
  std::uint8_t level = 0;
  while (level < kMostLevel && estimates[level].tilt > kCertain * kCertain) {
    const float squared = reach_of_level(first.squared, static_cast<std::uint8_t>(level + 1));
    if (squared > first.bound) break;
    const Moments m = around.grow_to(squared);
    const Estimate next{fit_plane(m), 0};
    const Plane& last = estimates[level].plane;
    if (!next.plane.valid() || is_slim(next.plane, m.count)) break;
    double deviations2 = kDeviations * kDeviations;
    if (last.least < kNoisy * last.middle && next.plane.least > kSteady * last.least) {
      const double steady = kSteady * last.least / next.plane.least;
      deviations2 *= steady * steady;
    }
    estimates[level + 1U] = {next.plane, tilt_variance(next.plane, m.count)};
    const bool fits = std::all_of(estimates.begin(), estimates.begin() + level + 1, [&](const Estimate& earlier) {
      return agree(earlier, estimates[level + 1U], deviations2);
    });
    if (!fits) break;
    ++level;
    if (m.count > kMostSamples) break;
  }
  return level;
}

float reach_of_level(float first_squared, std::uint8_t level) {
  return std::ldexp(first_squared, level);
}

float height_of_sheet(const SampleTree& tree, std::uint32_t place, const std::array<float, 3>& normal,
                      const SheetReach& reach) {
  constexpr float kColumn = 0.4F;  // of the plane's reach: that is wide for its direction, and curved
  constexpr float kBand = 0.6F;    // of the nearest samples' reach, which among noise grows with it
  constexpr float kTall = 2;       // bands
  constexpr float kStill = 0.01F;  // of a band
  constexpr int kMostSteps = 12;
  const float band = kBand * std::sqrt(reach.nearest);
  const float across = kColumn * kColumn * reach.plane;
  const float tall = kTall * band;
  std::vector<FourFloats> heights;
  tree.fours_within({place, -1, across + tall * tall}, [&](const SampleTree::FourSamples& four) {
    const auto& d = four.offset;
    const FourFloats h = normal[0] * d[0] + normal[1] * d[1] + normal[2] * d[2];
    const FourInts inside = (h < tall) & (h > -tall) & (four.squared - h * h < across);
    constexpr float kNowhere = std::numeric_limits<float>::max();  // far out of the band, wherever that is
    if (bits_of(inside) != 0) heights.push_back(inside ? h : FourFloats{} + kNowhere);
  });
  float at = 0;
  const float per_band = 1 / band;
  for (int step = 0; step < kMostSteps; ++step) {
    FourFloats sums{};
    FourFloats weights{};
    for (const FourFloats& h : heights) {
      const FourFloats u = (h - at) * per_band;
      const FourFloats w = 1 - u * u;
      const FourFloats w2 = where(w > 0, w * w);
      sums += w2 * h;
      weights += w2;
    }
    const float sum = sum_of(sums);
    const float weight = sum_of(weights);
    const float next = sum / weight;
    const bool still = std::abs(next - at) < kStill * band;
    at = next;
    if (still) break;
  }
  return at;
}

}  // namespace lamina::normals
