#include "mls/extension.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <Eigen/Core>
#include <cmath>

#include "mls/projected_scenes.h"

namespace lamina::test {
namespace {

void extend_all(StreamedCloud& s, const Kernel& kernel, float boundary) {
  for (std::int32_t slab = s.first; slab < s.end; ++slab) extend_slab(s.window, slab, kernel, boundary);
}

/// What the rule says of a corner.
struct Sign {
  bool outside = true, defined = false, supported = false;
  bool tie = false;   ///< the sign hangs on rounding
  bool edge = false;  ///< whether it is supported does
};

Sign sign_of(const std::map<Cell, OwnValue>& values, const Cell& c, double cell, double boundary) {
  Sign out;
  const auto own = values.find(c);
  if (own != values.end() && own->second.trusted) {
    out.defined = true;
    out.outside = own->second.channels[kDistance] >= 0;
  } else {
    double sum = 0;
    double terms = 0;
    double total = 0;
    Eigen::Vector3d offset = Eigen::Vector3d::Zero();
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();
    for_trusted_neighbours(values, c, cell, [&](const OwnValue& v, double w, double plane, const Cell& d) {
      out.defined = true;
      sum += w * plane;
      total += w;
      terms += w * (std::abs(v.channels[kDistance]) + 2 * cell);
      offset += w * Eigen::Vector3d(d.x, d.y, d.z);
      normal += w * Eigen::Vector3d(v.channels[kNormalX], v.channels[kNormalY], v.channels[kNormalZ]);
    });
    out.outside = sum >= 0;
    out.tie = out.defined && std::abs(sum) <= 64 * 0x1p-24 * terms;
    if (out.defined) {
      // How far the neighbours' mean lies aside, along the surface.
      const Eigen::Vector3d mean = offset / total;
      const double aside = (mean - mean.dot(normal) / normal.squaredNorm() * normal).norm();
      out.supported = aside <= 0.3;
      out.edge = std::abs(aside - 0.3) < 1e-3 || normal.norm() < 1e-2;
    } else if (own != values.end() && own->second.seen && own->second.channels[kOffsetFromMean] <= 0.7F) {
      out.defined = true;
      out.outside = own->second.channels[kDistance] >= 0;
    }
  }
  const bool seen = own != values.end() && own->second.seen;
  out.supported = out.supported || seen;
  if (boundary > 0 && seen && own->second.channels[kOffsetFromMean] > boundary) out.defined = false;
  return out;
}

TEST(Extension, SignsAreTheRule) {
  std::size_t skipping = 0;  // corners that no level in between holds
  for (const ProjectedScene& scene : projected_scenes()) {
    for (const float boundary : {0.0F, 0.25F, 0.7F}) {
      StreamedCloud s(random_cloud(scene.cloud, 21), scene.lattice, {}, 77);
      project_all(s);
      extend_all(s, select_kernel(), boundary);
      std::size_t own = 0;
      std::size_t extended = 0;
      std::size_t guessed = 0;
      std::size_t negative = 0;
      std::size_t beyond = 0;
      std::size_t surrounded = 0;
      for (int level = 0; level < scene.lattice.levels; ++level) {
        const auto values = own_values(s.window, level, s.first, s.end);
        for_set(s.window, level, s.first, s.end, &CornerBlock::corners,
                [&](int, const Cell& c, const CornerBlock& leaf, int offset) {
                  const bool outside = leaf.outside.test(offset);
                  const bool defined = leaf.defined.test(offset);
                  const bool supported = leaf.supported.test(offset);
                  if (leaf.shared.test(offset)) {
                    const HeldCorner finer = held_finer(s.window, level, c);
                    ASSERT_EQ(outside, finer.block->outside.test(offset_in_block(finer.corner)));
                    ASSERT_EQ(defined, finer.block->defined.test(offset_in_block(finer.corner)));
                    ASSERT_EQ(supported, finer.block->supported.test(offset_in_block(finer.corner)));
                    skipping += level - finer.level > 1 ? 1 : 0;
                    return;
                  }
                  if (boundary == 0) {  // one rule for signs and values
                    CornerValue value;
                    ASSERT_EQ(corner_value(s.window, level, c, value, nullptr), defined);
                    ASSERT_TRUE(!defined || outside == (value.distance >= 0)) << value.distance;
                  }
                  const Sign truth = sign_of(values, c, scene.lattice.cell_size(level), boundary);
                  ASSERT_EQ(defined, truth.defined) << "level " << level << " " << c.x << " " << c.y << " " << c.z;
                  if (!truth.edge) {
                    ASSERT_EQ(supported, truth.supported)
                        << "level " << level << " " << c.x << " " << c.y << " " << c.z;
                  }
                  surrounded += supported && !leaf.seen.test(offset) ? 1 : 0;
                  if (!truth.tie) {
                    ASSERT_EQ(outside, truth.outside) << "level " << level << " " << c.x << " " << c.y << " " << c.z;
                  }
                  const Sign unlimited = sign_of(values, c, scene.lattice.cell_size(level), 0);
                  (leaf.trusted.test(offset) ? own : unlimited.defined ? extended : guessed) += 1;
                  negative += outside ? 0 : 1;
                  beyond += unlimited.defined && !defined ? 1 : 0;
                });
        ASSERT_FALSE(HasFatalFailure());
        // Only corners carry bits.
        for (const auto mask : {&CornerBlock::outside, &CornerBlock::defined, &CornerBlock::supported}) {
          for_set(s.window, level, s.first, s.end, mask, [&](int, const Cell&, const CornerBlock& leaf, int offset) {
            ASSERT_TRUE(leaf.corners.test(offset));
          });
        }
      }
      EXPECT_GT(own, 100U);
      EXPECT_GT(extended, 100U);
      EXPECT_GT(guessed, 100U);
      EXPECT_GT(negative, 100U);
      EXPECT_GT(surrounded, 0U);
      EXPECT_EQ(beyond > 0, boundary > 0);
    }
  }
  EXPECT_GT(skipping, 5U);
}

TEST(Extension, KernelsThreadsAndOrderGiveTheSameBits) {
  for (const ProjectedScene& scene : projected_scenes()) {
    StreamedCloud s(random_cloud(scene.cloud, 22), scene.lattice, {}, 77);
    project_all(s);
    std::vector<std::set<Cell>> first;
    for (const Kernel& kernel : available_kernels()) {
      for (const std::size_t n : {1U, 4U}) {
        const tbb::global_control threads(tbb::global_control::max_allowed_parallelism, n);
        // Extension reads projected values alone, so it can be repeated, from above as well.
        for (std::int32_t slab = s.end - 1; slab >= s.first; --slab) extend_slab(s.window, slab, kernel, 0.5F);
        std::vector<std::set<Cell>> found;
        for (int level = 0; level < scene.lattice.levels; ++level) {
          for (const auto mask : {&CornerBlock::outside, &CornerBlock::defined, &CornerBlock::supported}) {
            found.push_back(set_cells(s.window, level, s.first, s.end, mask));
          }
        }
        if (first.empty()) first = found;
        ASSERT_TRUE(found == first) << kernel.name << ", " << n << " threads";
      }
    }
  }
}

}  // namespace
}  // namespace lamina::test
