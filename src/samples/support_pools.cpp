#include "samples/support_pools.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include "base/vectors.h"
#include "samples/sample_tree.h"

namespace lamina {
namespace {

/// Neighbouring places that are looked at together: a place alone is a single draw, and what chance makes of H from
/// place to place costs more than detail gains by a finer look.
constexpr std::size_t kPooled = 64;
/// And those that say what holds in the wider neighbourhood, where fewer are chance.
constexpr std::size_t kPooledAround = 128;
/// Errors count at most so many medians of all: strays.
constexpr float kMostError = 3;

/// H for a radius of the best disk. The fit of the projection knows normals as well, so it is as sure in a narrower
/// one.
constexpr double kSupportPerDisk = 0.65;
constexpr float kMostByDisk = 3;  ///< H: in plain parts wider ones gain nothing
/// H is at least so much, and so much more for each radius of error: fits to few very noisy samples go astray.
constexpr double kLeastBlend = 1.1;
constexpr double kBlendPerError = 3.5;
/// And for each radius by which the error is more than this so much more: noise that fills a disk looks smaller than it
/// is, since what lies as far off as the disk is wide counts as another sheet.
constexpr double kLargeError = 0.25;
constexpr double kBlendPerLargeError = 6;
/// A support reaches so much less than the neighbours that lie on all sides: between two lines of samples it has to
/// hold some of both.
constexpr float kAllRoundPerSupport = 1.25F;
constexpr double kAllRoundShare = 0.75;  ///< of the places around reach those neighbours

/// The best disk of some trials, and its error.
struct BestDisk {
  double radius = 0, error = 0;
};
BestDisk best_of(const std::array<double, kDisks.size()>& squares) {
  const auto least = std::min_element(squares.begin(), squares.end());
  const auto k = static_cast<std::size_t>(least - squares.begin());
  const auto disk = [](std::size_t at) { return double{kDisks[at]}; };
  double radius = disk(k);
  if (k > 0 && k + 1 < kDisks.size()) {
    // Where the parabola through three has its lowest point.
    const double bend = squares[k - 1] - 2 * squares[k] + squares[k + 1];
    const double step = bend > 0 ? 0.5 * (squares[k - 1] - squares[k + 1]) / bend : 0;
    radius += step * (step > 0 ? disk(k + 1) - disk(k) : disk(k) - disk(k - 1));
  }
  return {radius, std::sqrt(*least)};
}

/// H that reaches neighbours on all sides at most of some places. Those at rims have none.
float blend_all_round(std::vector<float>& distances) {
  std::erase_if(distances, [](float d) { return std::isinf(d); });
  return distances.size() < kPooled / 2 ? 0 : quantile_of(distances, kAllRoundShare) / kAllRoundPerSupport;
}

/// What some places say together.
struct Pool {
  std::array<double, kDisks.size()> squares{};
  std::vector<float> all_round;
};

Pool pool_of(std::span<const Trial* const> trials, std::size_t first, std::size_t step, float most) {
  Pool pool;
  for (std::size_t i = first; i < trials.size(); i += step) {
    pool.all_round.push_back(trials[i]->all_round);
    for (std::size_t k = 0; k < kDisks.size(); ++k) {
      const double error = static_cast<double>(std::min(trials[i]->error[k], most));
      pool.squares[k] += error * error;
    }
  }
  for (double& square : pool.squares) square /= static_cast<double>(std::max<std::size_t>(1, pool.all_round.size()));
  return pool;
}

float blend_of(const Pool& pool, float all_round, SupportAim aim) {
  const float sides = std::clamp(all_round, kLeastSupport, kMostAllRound);
  if (aim == SupportAim::all_round) return sides;
  const BestDisk best = best_of(pool.squares);
  const double by_disk = std::min(kSupportPerDisk * best.radius, double{kMostByDisk});
  const double by_error =
      kLeastBlend + kBlendPerError * best.error + kBlendPerLargeError * std::max(0.0, best.error - kLargeError);
  return std::max(sides, std::clamp(static_cast<float>(std::max(by_disk, by_error)), kLeastSupport, kMostSupport));
}

/// H at a place by those near it, by those of the wider neighbourhood, and by halves of those near it.
struct Draw {
  float sides = 0;  ///< what reaches neighbours on all sides
  float near = 0, around = 0;
  std::array<float, 2> halves{};
};

/// `trials`: of the place itself, then of those around, the nearest first.
Draw draw_of(std::span<const Trial* const> trials, float most, SupportAim aim) {
  const auto near = trials.first(std::min(trials.size(), kPooled));
  Draw draw;
  Pool pool = pool_of(near, 0, 1, most);
  draw.sides = blend_all_round(pool.all_round);
  draw.near = blend_of(pool, draw.sides, aim);
  const auto blend = [&](std::span<const Trial* const> of, std::size_t first, std::size_t step) {
    Pool some = pool_of(of, first, step, most);
    return blend_of(some, blend_all_round(some.all_round), aim);
  };
  draw.around = blend(trials, 0, 1);
  for (std::size_t half = 0; half < 2; ++half) draw.halves[half] = near.size() > 1 ? blend(near, half, 2) : draw.near;
  return draw;
}

/// The share of the differences between near and around that is not chance, 0 to 1. Halves differ by chance alone, and
/// their mean by half as much.
float reliability(const std::vector<Draw>& draws) {
  double chance = 0, all = 0;
  for (const Draw& d : draws) {
    const double between = 0.5 * static_cast<double>(d.halves[0] - d.halves[1]);
    const double apart = static_cast<double>(d.near - d.around);
    chance += between * between;
    all += apart * apart;
  }
  return all > chance ? static_cast<float>(1 - chance / all) : 0;
}

}  // namespace

SupportSurvey pool_places(const std::vector<TriedPlace>& places, SupportAim aim) {
  std::vector<float> errors;
  errors.reserve(places.size());
  std::array<std::vector<std::int32_t>, 3> at;
  for (const TriedPlace& p : places) {
    errors.push_back(p.trial.error[kMiddleDisk]);
    for (std::size_t k = 0; k < 3; ++k) at[k].push_back(p.at[k]);
  }
  const float most = kMostError * median_of(errors);
  const SampleTree tree(at[0], at[1], at[2]);
  std::vector<Draw> draws(places.size());
  tbb::parallel_for(std::size_t{0}, places.size(), [&](std::size_t p) {
    std::array<Neighbour, kPooledAround - 1> found;
    const std::size_t n =
        tree.nearest(static_cast<std::uint32_t>(p), found.size(), std::numeric_limits<float>::infinity(), found.data());
    std::vector<const Trial*> trials{&places[tree.order()[p]].trial};
    for (std::size_t i = 0; i < n; ++i) trials.push_back(&places[tree.order()[found[i].sample]].trial);
    draws[p] = draw_of(trials, most, aim);
  });
  SupportSurvey out;
  out.places.resize(places.size());
  std::vector<float> sides;
  sides.reserve(draws.size());
  for (const Draw& d : draws) sides.push_back(d.sides);
  out.lines = median_of(sides) > kLeastSupport;
  // Where samples lie on lines, the lines around a place say how far it is to the next.
  const float reliable = out.lines ? 1 : reliability(draws);
  for (std::size_t p = 0; p < places.size(); ++p) {
    const Draw& d = draws[p];
    SupportPlace& made = out.places[tree.order()[p]];
    made.blend = std::max(d.near, d.around + reliable * (d.near - d.around));
    for (std::size_t k = 0; k < 3; ++k) made.at[k] = static_cast<float>(places[tree.order()[p]].at[k]);
  }
  if (aim == SupportAim::all_round && !out.lines) out.places.clear();
  return out;
}

}  // namespace lamina
