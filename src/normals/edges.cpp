#include "normals/edges.h"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "normals/planes.h"
#include "samples/consensus_plane.h"

namespace lamina::normals {
namespace {

/// Looked at around a sample, of the squared reach of its first plane: three times as many samples.
constexpr float kAround = 3;
constexpr int kFits = 2;

/// Variances of the planes around: the eighth part from below of a sample's and its links'. Twice over, that of samples
/// far enough from an edge to have planes without it.
class QuietVariances {
 public:
  QuietVariances(const std::vector<float>& variance, const Links& links) : variance_(variance), links_(links) {}

  /// Of a core sample, by number; below 0 where none is known.
  [[nodiscard]] float of(std::size_t i) const {
    return low_one(i, [&](std::uint32_t place) {
      const auto found = std::lower_bound(links_.core.begin(), links_.core.end(), place);
      if (found == links_.core.end() || *found != place) return -1.0F;
      return low_one(static_cast<std::size_t>(found - links_.core.begin()),
                     [&](std::uint32_t other) { return variance_[other]; });
    });
  }

 private:
  /// Of what is known of a sample and its links.
  template <class Variance>
  [[nodiscard]] float low_one(std::size_t i, const Variance& variance) const {
    std::array<float, Links::kMost + 1> known;
    std::size_t n = 0;
    const auto take = [&](std::uint32_t place) {
      const float v = variance(place);
      if (v >= 0) known[n++] = v;
    };
    take(links_.core[i]);
    for (const std::uint32_t place : links_.neighbours[i]) take(place);
    if (n == 0) return -1;
    std::nth_element(known.begin(), known.begin() + n / 8, known.begin() + n);
    return known[n / 8];
  }

  const std::vector<float>& variance_;
  const Links& links_;
};

class EdgeSharpener {
 public:
  EdgeSharpener(const SampleTree& tree, WindowSamples& samples) : tree_(tree), samples_(samples) { plane_.stride = 3; }

  /// `noise`: deviation, `reach`: of the first plane, steps.
  void sharpen(std::uint32_t place, float noise, float reach) {
    const float around = std::sqrt(kAround) * reach;
    gather(place, around);
    plane_.distance = kOnSide * noise / around;
    const std::array<float, 3> own{samples_.nx[place], samples_.ny[place], samples_.nz[place]};
    std::array<float, 3> found{};
    if (!plane_.find(own, found)) return;
    // That holds curved sides as well, but passes through the sample, whose noise it follows.
    for (int fit = 0; fit < kFits; ++fit) found = fitted(found);
    samples_.nx[place] = found[0];
    samples_.ny[place] = found[1];
    samples_.nz[place] = found[2];
    samples_.lift[place] = 0;
  }

 private:
  /// Of the samples near a plane through this one, which need not lie on it more exactly than they.
  [[nodiscard]] std::array<float, 3> fitted(const std::array<float, 3>& normal) const {
    Moments near;
    for (const std::array<float, 3>& p : plane_.neighbours) {
      const float h = (p[0] * normal[0] + p[1] * normal[1] + p[2] * normal[2]) / plane_.distance;
      const float weight = (1 - h * h) * (1 - (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]));
      if (weight > 0) near.add(p, double{weight});
    }
    const Plane plane = fit_plane(near);
    return plane.valid() ? plane.normal : normal;
  }
  void gather(std::uint32_t place, float around) {
    plane_.neighbours.clear();
    const float per = 1 / around;
    tree_.fours_within({place, -1, around * around}, [&](const SampleTree::FourSamples& four) {
      for (std::size_t k = 0; k < 4; ++k) {
        const std::array<float, 3> p{per * four.offset[0][k], per * four.offset[1][k], per * four.offset[2][k]};
        const float squared = p[0] * p[0] + p[1] * p[1] + p[2] * p[2];
        if (squared > 0 && squared < 1) plane_.neighbours.push_back(p);
      }
    });
  }

  const SampleTree& tree_;
  WindowSamples& samples_;
  ConsensusPlane plane_;
};

}  // namespace

void sharpen_edges(const SampleTree& tree, const FirstPlanes& planes, const Links& links, WindowSamples& samples) {
  const QuietVariances quiet(planes.variance, links);
  tbb::enumerable_thread_specific<EdgeSharpener> sharpeners([&] { return EdgeSharpener(tree, samples); });
  const auto sharpen = [&](std::size_t i) {
    const std::uint32_t place = links.core[i];
    const float squared = planes.reach[i];
    const float own = planes.variance[place];
    if (squared == 0 || own < kSharp * kSharp * squared || !samples.has_normal(place)) return;
    const float noise = quiet.of(i);
    const float near = kOnSide * kOnSide * noise;
    if (own < kEdgeDeviation * kEdgeDeviation * noise || near < kLeastOnSide * kLeastOnSide * squared ||
        near > kMostOnSide * kMostOnSide * squared)
      return;
    sharpeners.local().sharpen(place, std::sqrt(noise), std::sqrt(squared));
  };
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, links.core.size(), 512), [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) sharpen(i);
  });
}

}  // namespace lamina::normals
