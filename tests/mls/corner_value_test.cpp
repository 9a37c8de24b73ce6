#include "mls/extension.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>

#include "mls/projected_scenes.h"

namespace lamina::test {
namespace {

constexpr double kRounding = 64 * 0x1p-24;

struct Truth {
  bool found = false, own = false;
  std::vector<double> channels, error;
};

/// The rule: the corner's own value where it is trusted, else the mean of its trusted neighbours' planes.
Truth truth_of(const std::map<Cell, OwnValue>& values, const Cell& c, double cell, int channels) {
  Truth t{false, false, std::vector<double>(channels, 0.0), std::vector<double>(channels, 0.0)};
  const auto own = values.find(c);
  if (own != values.end() && own->second.trusted) {
    t.found = t.own = true;
    t.channels = own->second.channels;
    return t;
  }
  double weight = 0;
  for_trusted_neighbours(values, c, cell, [&](const OwnValue& v, double w, double plane, const Cell&) {
    weight += w;
    for (int k = 0; k < channels; ++k) {
      t.channels[k] += w * (k == kDistance ? plane : v.channels[k]);
      t.error[k] += w * kRounding * (std::abs(v.channels[k]) + (k == kDistance ? 2 * cell : 0));
    }
  });
  if (weight <= 0) return t;
  t.found = true;
  for (int k = 0; k < channels; ++k) {
    t.channels[k] /= weight;
    t.error[k] /= weight;
  }
  const double length = std::hypot(t.channels[kNormalX], t.channels[kNormalY], t.channels[kNormalZ]);
  for (int k = kNormalX; k <= kNormalZ; ++k) {
    t.channels[k] /= length;
    t.error[k] = kRounding / length;
  }
  t.channels[kOffsetFromMean] = t.error[kOffsetFromMean] = 0;
  return t;
}

std::vector<float> channels_of(const CornerValue& v, const std::vector<float>& attributes) {
  std::vector<float> out{v.distance, v.normal[0], v.normal[1], v.normal[2], v.curvature, v.offset_from_mean};
  out.resize(kFirstAttribute, 0);  // the lean and the crease are no part of it
  out.insert(out.end(), attributes.begin(), attributes.end());
  return out;
}

TEST(CornerValue, OwnOrExtendedTheSameFromEveryLevel) {
  std::size_t shared = 0;
  for (const ProjectedScene& scene : projected_scenes()) {
    StreamedCloud s(random_cloud(scene.cloud, 31), scene.lattice, {}, 77);
    project_all(s);
    std::size_t own = 0;
    std::size_t extended = 0;
    std::size_t none = 0;
    for (int level = 0; level < scene.lattice.levels; ++level) {
      const auto values = own_values(s.window, level, s.first, s.end);
      for_set(s.window, level, s.first, s.end, &CornerBlock::corners,
              [&](int, const Cell& c, const CornerBlock& leaf, int offset) {
                const CornerValue untouched{-7, {-8, -9, -10}, -11, -12};
                CornerValue value = untouched;
                std::vector<float> attributes(static_cast<std::size_t>(s.window.attributes()), -1);
                const bool found = corner_value(s.window, level, c, value, attributes.data());
                const std::vector<float> channels = channels_of(value, attributes);
                CornerValue bare = untouched;
                ASSERT_EQ(corner_value(s.window, level, c, bare, nullptr), found);
                ASSERT_EQ(channels_of(bare, {}), channels_of(value, {}));
                if (!found) {
                  ASSERT_EQ(channels_of(value, {}), channels_of(untouched, {}));
                }
                if (leaf.shared.test(offset)) {
                  CornerValue finer = untouched;
                  std::vector<float> of_finer(attributes.size(), -1);
                  const HeldCorner held = held_finer(s.window, level, c);
                  ASSERT_EQ(corner_value(s.window, held.level, held.corner, finer, of_finer.data()), found);
                  const std::vector<float> other = channels_of(finer, of_finer);
                  for (std::size_t k = 0; k < other.size(); ++k) {
                    ASSERT_EQ(std::bit_cast<std::uint32_t>(other[k]), std::bit_cast<std::uint32_t>(channels[k]));
                  }
                  ++shared;
                  return;
                }
                const Truth truth = truth_of(values, c, scene.lattice.cell_size(level), s.window.channels());
                ASSERT_EQ(found, truth.found);
                (truth.own ? own : found ? extended : none) += 1;
                for (std::size_t k = 0; found && k < channels.size(); ++k) {
                  if (k >= kLean && k < kFirstAttribute) continue;
                  ASSERT_NEAR(channels[k], truth.channels[k], truth.error[k])
                      << "channel " << k << " level " << level << " " << c.x << " " << c.y << " " << c.z;
                }
              });
      ASSERT_FALSE(HasFatalFailure());
    }
    EXPECT_GT(own, 100U);
    EXPECT_GT(extended, 100U);
    EXPECT_GT(none, 100U);
  }
  EXPECT_GT(shared, 200U);
}

}  // namespace
}  // namespace lamina::test
