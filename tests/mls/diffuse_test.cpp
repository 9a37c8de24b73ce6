#include "mls/project.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <optional>

#include "support/random_cloud.h"
#include "support/streamed_cloud.h"
#include "support/window_contents.h"

namespace lamina::test {
namespace {

/// A projected centre of a leaf cell.
struct Centre {
  std::array<std::int64_t, 3> low;  ///< the cell's lower end, steps
  std::int64_t size;
  bool trusted;
  std::vector<double> values;  ///< channels
};

std::vector<Centre> centres_of(const Window& window, std::int32_t first, std::int32_t end) {
  std::vector<Centre> out;
  for (int level = 0; level < window.levels(); ++level) {
    for_set(window, level, first, end, &CornerBlock::cells,
            [&](int, const Cell& c, const CornerBlock& leaf, int offset) {
              if (leaf.centres == nullptr || !leaf.centres->seen.test(offset)) return;
              const auto at = window.lattice().position(level, c);
              Centre centre{
                  {at[0], at[1], at[2]}, window.lattice().cell_size(level), leaf.centres->trusted.test(offset), {}};
              const CornerValues& v = leaf.centres->values[window.slab_in_leaf(level, offset >> 6)];
              const std::uint32_t i = leaf.centres->value_index(offset, window.slab_layers(level));
              for (int channel = 0; channel < window.channels(); ++channel)
                centre.values.push_back(v.channel(channel)[i]);
              out.push_back(std::move(centre));
            });
  }
  return out;
}

struct Mean {
  bool trusted = false;
  std::vector<double> values, error;
};

/// The mean over the leaf cells that touch a point, by definition: all cells are looked at.
std::optional<Mean> mean_at(const std::vector<Centre>& centres, const std::array<std::int32_t, 3>& p, int channels) {
  std::vector<const Centre*> around;
  bool trusted = false;
  for (const Centre& c : centres) {
    bool touches = true;
    for (int k = 0; k < 3; ++k) touches = touches && c.low[k] <= p[k] && p[k] <= c.low[k] + c.size;
    if (!touches) continue;
    around.push_back(&c);
    trusted = trusted || c.trusted;
  }
  Mean mean{trusted, std::vector<double>(channels, 0.0), std::vector<double>(channels, 0.0)};
  double weight = 0;
  for (const Centre* c : around) {
    if (trusted && !c->trusted) continue;
    const double w = 1.0 / static_cast<double>(c->size);
    weight += w;
    // From the centre to the point; the distance there of the sphere that osculates the centre's surface.
    std::array<double, 3> o{};
    double along = 0;
    double length2 = 0;
    for (int k = 0; k < 3; ++k) {
      o[k] = static_cast<double>(p[k]) - (static_cast<double>(c->low[k]) + 0.5 * static_cast<double>(c->size));
      along += o[k] * c->values[kNormalX + k];
      length2 += o[k] * o[k];
    }
    for (int channel = 0; channel < channels; ++channel) {
      double value = c->values[channel];
      double terms = std::abs(value);
      if (channel == kDistance) {
        value += along + 0.5 * c->values[kCurvature] * (length2 - along * along);
        terms += std::sqrt(length2) + std::abs(c->values[kCurvature]) * length2;
      }
      mean.values[channel] += w * value;
      mean.error[channel] += w * terms * 40 * 0x1p-24;
    }
  }
  if (weight <= 0) return std::nullopt;
  for (int channel = 0; channel < channels; ++channel) {
    mean.values[channel] /= weight;
    mean.error[channel] /= weight;
  }
  const double length = std::hypot(mean.values[kNormalX], mean.values[kNormalY], mean.values[kNormalZ]);
  if (length < 1e-6) return std::nullopt;
  for (int k = 0; k < 3; ++k) {
    mean.values[kNormalX + k] /= length;
    mean.error[kNormalX + k] = 40 * 0x1p-24 / length;
  }
  return mean;
}

struct DiffuseScene {
  CloudSettings cloud;
  Lattice lattice;
};
std::vector<DiffuseScene> diffuse_scenes() {
  std::vector<DiffuseScene> out{{{Shape::sphere, 400, {-300, 700, 50}, 600, 70, 350}, {64, 3}},
                                {{Shape::torus, 400, {5000, 0, -5000}, 700, 60, 400}, {50, 4}},
                                {{Shape::scatter, 150, {0, 0, 0}, 500, 70, 300}, {61, 3}}};
  out[0].cloud.attributes = 2;
  out[1].cloud.noise = 0.1;
  out[2].cloud.radius_spread = 2;
  return out;
}

void diffuse_all(StreamedCloud& s) {
  ProjectSettings settings;
  settings.centres = true;
  Projector projector(settings, select_kernel());
  for (std::int32_t slab = s.first; slab < s.end; ++slab) {
    projector.project(s.window, slab, s.feed);
    diffuse_slab(s.window, slab);
  }
}

TEST(Diffuse, CornersTakeTheMeanOfTheCellsThatTouchThem) {
  for (const DiffuseScene& scene : diffuse_scenes()) {
    StreamedCloud s(random_cloud(scene.cloud, 11), scene.lattice, {}, 83);
    diffuse_all(s);
    const std::vector<Centre> centres = centres_of(s.window, s.first, s.end);
    std::size_t compared = 0;
    std::size_t shared = 0;
    std::size_t trusted = 0;
    for (int level = 0; level < scene.lattice.levels; ++level) {
      for_set(s.window, level, s.first, s.end, &CornerBlock::corners,
              [&](int, const Cell& c, const CornerBlock& leaf, int offset) {
                if (!leaf.active.test(offset)) {
                  ASSERT_FALSE(leaf.seen.test(offset));
                  return;
                }
                const auto truth = mean_at(centres, scene.lattice.position(level, c), s.window.channels());
                ASSERT_EQ(leaf.seen.test(offset), truth.has_value()) << c.x << " " << c.y << " " << c.z;
                ASSERT_EQ(leaf.trusted.test(offset), truth.has_value() && truth->trusted);
                if (!truth.has_value()) return;
                ++compared;
                trusted += truth->trusted ? 1 : 0;
                shared += leaf.shared.test(offset) ? 1 : 0;
                const CornerValues& v = leaf.values[s.window.slab_in_leaf(level, offset >> 6)];
                const std::uint32_t i = leaf.value_index(offset, s.window.slab_layers(level));
                for (int channel = 0; channel < s.window.channels(); ++channel) {
                  if (channel == kLean) continue;  // packed: no number
                  ASSERT_NEAR(v.channel(channel)[i], truth->values[channel], truth->error[channel])
                      << "channel " << channel << " level " << level;
                }
              });
      ASSERT_FALSE(HasFatalFailure());
    }
    EXPECT_GT(compared, 1000U);
    EXPECT_GT(shared, 50U);
    EXPECT_GT(trusted, 300U);
    EXPECT_GT(compared - trusted, 100U);
  }
}

TEST(Diffuse, ThreadsGiveTheSameBits) {
  for (const DiffuseScene& scene : diffuse_scenes()) {
    std::vector<std::uint64_t> bits;
    for (const std::size_t n : {1U, 2U, 4U}) {
      const tbb::global_control threads(tbb::global_control::max_allowed_parallelism, n);
      StreamedCloud s(random_cloud(scene.cloud, 12), scene.lattice, {}, 83);
      diffuse_all(s);
      const auto found = all_bits(s.window, s.first, s.end);
      if (n == 1) bits = found;
      ASSERT_TRUE(found == bits) << n << " threads";
    }
  }
}

}  // namespace
}  // namespace lamina::test
