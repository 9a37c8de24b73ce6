#include "levelset/brick_leaves.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <optional>

#include "lamina/error.h"
#include "lamina/volume_export.h"
#include "lattice/mask_axes.h"
#include "levelset/brick_sides.h"
#include "vdb/full_range.h"
#include "vdb/pack_leaf.h"

namespace lamina::volume {
std::vector<ExtraGrid> resolve_grids(const std::vector<std::string>& names, const AttributeLayout& layout, double step,
                                     std::vector<int>& channels) {
  const auto red = find_attribute(layout, "red"), green = find_attribute(layout, "green"),
             blue = find_attribute(layout, "blue");
  const bool coloured = red && green && blue;
  const auto channel = [&](int c) {
    const auto at = std::find(channels.begin(), channels.end(), c);
    if (at != channels.end()) return static_cast<int>(at - channels.begin());
    channels.push_back(c);
    return static_cast<int>(channels.size()) - 1;
  };
  const auto attribute = [&](std::size_t i) { return channel(kFirstAttribute + static_cast<int>(i)); };
  std::vector<ExtraGrid> out;
  for (const std::string& word : names) {
    const bool automatic = word == VolumeExport::kColours;
    const std::string name = automatic ? "Cd" : word;
    if (automatic && !coloured) continue;
    if (std::any_of(out.begin(), out.end(), [&](const ExtraGrid& g) { return g.name == name; })) continue;
    if (name == "N") {
      out.push_back({name, ExtraGrid::Kind::normal, {}, 1});
    } else if (name == "Cd" && coloured) {
      out.push_back({name,
                     ExtraGrid::Kind::vector,
                     {attribute(*red), attribute(*green), attribute(*blue)},
                     1 / full_range(layout[*red].type)});
    } else if (name == "weight") {
      out.push_back({name, ExtraGrid::Kind::weight, {channel(kOffsetFromMean)}, 1});
    } else if (name == "curvature") {
      out.push_back({name, ExtraGrid::Kind::scalar, {channel(kCurvature)}, static_cast<float>(1 / step)});
    } else if (const auto i = find_attribute(layout, name)) {
      out.push_back({name, ExtraGrid::Kind::scalar, {attribute(*i)}, 1});
    } else {
      std::string known = coloured ? "N, Cd, weight, curvature" : "N, weight, curvature";
      for (const AttributeSpec& a : layout) known += ", " + a.name;
      throw Error(ExitCode::usage,
                  fmt::format("--vdb-grids {}: the points have no such attribute; there are {}", name, known));
    }
  }
  return out;
}

LeafMaker::LeafMaker(const Band& b, const GridFrame& g, const std::vector<ExtraGrid>& e, const Eigen::Matrix3d& r,
                     bool h)
    : band(b), grid(g), extras(e), rotation(r), half(h) {
  // OpenVDB's z is the fastest.
  for (std::size_t k = 0; k < 3; ++k) axes[k] = 2 - grid.axis_of[k];
  for (int at = 0; at < 512; ++at) {
    const int there = (at & 7) << (3 * axes[0]) | (at >> 3 & 7) << (3 * axes[1]) | (at >> 6) << (3 * axes[2]);
    voxel_at[static_cast<std::size_t>(there)] = static_cast<std::uint16_t>(at);
  }
}

void LeafMaker::operator()(const Brick& brick, BrickLeaves& out) const {
  out.any = false;
  if (!brick.active.any()) return;
  out.any = true;
  out.leaves.resize(1 + extras.size());
  LeafMasks masks{with_axes(brick.active, axes), with_axes(inside_of(brick.negative, band.all(brick)), axes)};
  // The active voxels of the brick in the leaf's order.
  std::array<std::uint16_t, 512> order;
  std::size_t count = 0;
  for (int x = 0; x < 8; ++x) {
    for (std::uint64_t w = masks.active.words[x]; w != 0; w &= w - 1) {
      order[count] = voxel_at[x * 64 + std::countr_zero(w)];
      __builtin_prefetch(&brick.plane[order[count++]]);
    }
  }

  const openvdb::Coord origin = grid.index({brick.block.x * 8, brick.block.y * 8, brick.block.z * 8});
  std::array<float, 3 * 512> values;
  const std::span<const float> scalars{values.data(), count}, vectors{values.data(), 3 * count};
  const auto voxel = static_cast<float>(grid.voxel);
  for (std::size_t i = 0; i < count; ++i) values[i] = brick.distance(order[i]) * voxel;
  pack(origin, masks, scalars, 1, half, out.leaves[0]);
  out.leaves[0].faces = face_votes(masks.active, masks.inside);

  masks.inside = {};
  for (std::size_t e = 0; e < extras.size(); ++e) {
    const ExtraGrid& extra = extras[e];
    PackedLeaf& leaf = out.leaves[1 + e];
    const auto value = [&](std::size_t k, int at) {
      return extra.scale *
             brick.extra[static_cast<std::size_t>(extra.channels[k]) * 512 + static_cast<std::size_t>(at)];
    };
    if (extra.kind == ExtraGrid::Kind::scalar || extra.kind == ExtraGrid::Kind::weight) {
      const bool weight = extra.kind == ExtraGrid::Kind::weight;
      for (std::size_t i = 0; i < count; ++i) {
        // Extended beyond what was projected nothing speaks for a voxel but its neighbours.
        const float own = brick.known[0].test(order[i]) ? std::max(0.0F, 1 - value(0, order[i])) : 0.0F;
        values[i] = weight ? own : value(0, order[i]);
      }
      pack(origin, masks, scalars, 1, half, leaf);
      continue;
    }
    for (std::size_t i = 0; i < count; ++i) {
      const int at = order[i];
      float* const v = &values[3 * i];
      if (extra.kind == ExtraGrid::Kind::vector) {
        for (std::size_t k = 0; k < 3; ++k) v[k] = value(k, at);
      } else {
        const Plane& plane = brick.plane[static_cast<std::size_t>(at)];
        const Eigen::Vector3d n = rotation.transpose() * Eigen::Vector3d(plane[0], plane[1], plane[2]);
        for (int k = 0; k < 3; ++k) v[k] = static_cast<float>(n[k]);
      }
    }
    pack(origin, masks, vectors, 3, half, leaf);
  }
}

}  // namespace lamina::volume
