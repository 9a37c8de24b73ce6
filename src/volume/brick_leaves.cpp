#include "volume/brick_leaves.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <optional>

#include "lamina/error.h"
#include "lamina/volume_export.h"
#include "volume/full_range.h"
#include "window/bits.h"

namespace lamina::volume {
namespace {

using FloatLeaf = openvdb::FloatTree::LeafNodeType;
using VectorLeaf = openvdb::Vec3STree::LeafNodeType;

/// A voxel's layer beside: one step along every axis.
BlockMask dilated(const BlockMask& m) {
  BlockMask out = m;
  for (int z = 0; z < 8; ++z) {
    const std::uint64_t w = m.words[z];
    out.words[z] |= bits::shift_x(0, w, 0, 1) | bits::shift_x(0, w, 0, -1) | w << 8 | w >> 8;
    if (z > 0) out.words[z] |= m.words[z - 1];
    if (z < 7) out.words[z] |= m.words[z + 1];
  }
  return out;
}

/// Voxels nobody knows take the side of the nearest that somebody does, outside first.
BlockMask inside_of(const Brick& brick, const BlockMask& known) {
  BlockMask inside, outside;
  for (int z = 0; z < 8; ++z) {
    for (std::uint64_t w = known.words[z]; w != 0; w &= w - 1) {
      const int at = z * 64 + std::countr_zero(w);
      (brick.distance[at] < 0 ? inside : outside).set(at);
    }
  }
  if (!inside.any()) return inside;
  for (int step = 0; step < 24 && inside.count() + outside.count() < 512; ++step) {
    const BlockMask more = dilated(outside), less = dilated(inside);
    for (int z = 0; z < 8; ++z) {
      const std::uint64_t free = ~(inside.words[z] | outside.words[z]);
      outside.words[z] |= more.words[z] & free;
      inside.words[z] |= less.words[z] & free & ~more.words[z];
    }
  }
  return inside;
}

std::optional<int> find(const AttributeLayout& layout, const std::string& name) {
  for (std::size_t i = 0; i < layout.size(); ++i)
    if (layout[i].name == name) return static_cast<int>(i);
  return std::nullopt;
}

}  // namespace

std::vector<ExtraGrid> resolve_grids(const std::vector<std::string>& names, const AttributeLayout& layout, double step,
                                     std::vector<int>& channels) {
  const auto red = find(layout, "red"), green = find(layout, "green"), blue = find(layout, "blue");
  const bool coloured = red && green && blue;
  const auto channel = [&](int c) {
    const auto at = std::find(channels.begin(), channels.end(), c);
    if (at != channels.end()) return static_cast<int>(at - channels.begin());
    channels.push_back(c);
    return static_cast<int>(channels.size()) - 1;
  };
  const auto attribute = [&](int i) { return channel(kFirstAttribute + i); };
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
                     1 / full_range(layout[static_cast<std::size_t>(*red)].type)});
    } else if (name == "weight") {
      out.push_back({name, ExtraGrid::Kind::weight, {channel(kReach)}, 1});
    } else if (name == "curvature") {
      out.push_back({name, ExtraGrid::Kind::scalar, {channel(kCurvature)}, static_cast<float>(1 / step)});
    } else if (const auto i = find(layout, name)) {
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

BrickLeaves LeafMaker::operator()(const Brick& brick) const {
  BrickLeaves out;
  const BlockMask& known = band.all(brick);
  BlockMask active;
  const auto limit = static_cast<float>(band.settings().band);
  for (int z = 0; z < 8; ++z) {
    for (std::uint64_t w = known.words[z]; w != 0; w &= w - 1) {
      const int at = z * 64 + std::countr_zero(w);
      if (std::abs(brick.distance[at]) < limit) active.set(at);
    }
  }
  if (!active.any()) return out;
  out.any = true;
  const BlockMask inside = inside_of(brick, known);
  const openvdb::Coord origin = grid.index({brick.block.x * 8, brick.block.y * 8, brick.block.z * 8});
  std::array<openvdb::Index, 512> place;  // of each voxel of the brick in the leaf
  for (int at = 0; at < 512; ++at) place[at] = FloatLeaf::coordToOffset(grid.index({at & 7, at >> 3 & 7, at >> 6}));

  const auto for_active = [&](const auto& visit) {
    for (int z = 0; z < 8; ++z)
      for (std::uint64_t w = active.words[z]; w != 0; w &= w - 1) visit(z * 64 + std::countr_zero(w));
  };
  FloatLeaf leaf(origin, background);
  const auto voxel = static_cast<float>(grid.voxel);
  for (int at = 0; at < 512; ++at)
    if (inside.test(at)) leaf.setValueOnly(place[at], -background);
  for_active([&](int at) { leaf.setValueOn(place[at], brick.distance[at] * voxel); });
  out.leaves.push_back(pack(leaf, background, half));

  for (const ExtraGrid& extra : extras) {
    const auto value = [&](std::size_t k, int at) {
      return extra.scale *
             brick.extra[static_cast<std::size_t>(extra.channels[k]) * 512 + static_cast<std::size_t>(at)];
    };
    if (extra.kind == ExtraGrid::Kind::scalar || extra.kind == ExtraGrid::Kind::weight) {
      FloatLeaf scalars(origin, 0);
      const bool weight = extra.kind == ExtraGrid::Kind::weight;
      // Extended beyond what was projected nothing speaks for a voxel but its neighbours.
      for_active([&](int at) {
        const float own = brick.known[0].test(at) ? std::max(0.0F, 1 - value(0, at)) : 0.0F;
        scalars.setValueOn(place[at], weight ? own : value(0, at));
      });
      out.leaves.push_back(pack(scalars, 0, half));
      continue;
    }
    VectorLeaf vectors(origin, openvdb::Vec3s(0));
    for_active([&](int at) {
      openvdb::Vec3s v;
      if (extra.kind == ExtraGrid::Kind::vector) {
        for (int k = 0; k < 3; ++k) v[k] = value(static_cast<std::size_t>(k), at);
      } else {
        const Eigen::Vector3d n = rotation.transpose() * Eigen::Vector3d(brick.normal_at(0, at), brick.normal_at(1, at),
                                                                         brick.normal_at(2, at));
        for (int k = 0; k < 3; ++k) v[k] = static_cast<float>(n[k]);
      }
      vectors.setValueOn(place[at], v);
    });
    out.leaves.push_back(pack(vectors, half));
  }
  return out;
}

}  // namespace lamina::volume
