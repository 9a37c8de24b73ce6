#include "vdb/points_grid.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/number.h"
#include "base/run.h"
#include "lamina/error.h"
#include "vdb/vdb_file.h"

namespace lamina::volume {
namespace {

using namespace openvdb;
using points::AttributeSet;
using points::AttributeWriteHandle;
using points::PointDataGrid;
using points::PointDataTree;
using points::TypedAttributeArray;

/// One array of the points grid, and the arrays of the cloud it is made of.
struct PointColumn {
  enum class Kind : std::uint8_t { float32, int32, vector };
  std::string name;
  Kind kind = Kind::float32;
  std::array<const float*, 3> from{};  ///< one for scalars
  float scale = 1;
  std::string types;  ///< of the attributes it came from, for the way back
};

bool is_real(ScalarType type) {
  return type == ScalarType::float32 || type == ScalarType::float64;
}

/// Where a point lies: leaf, place in the leaf, row.
struct Place {
  Coord leaf;
  std::uint32_t voxel;
  std::uint64_t row;
  bool operator<(const Place& o) const {
    if (leaf != o.leaf) return leaf < o.leaf;
    return voxel != o.voxel ? voxel < o.voxel : row < o.row;
  }
};

Vec3d index_of(const PointArrays& points, const math::Transform& transform, std::size_t row) {
  return transform.worldToIndex(Vec3d(points.samples.x[row], points.samples.y[row], points.samples.z[row]));
}

std::vector<Place> sorted_places(const PointArrays& points, const math::Transform& transform) {
  std::vector<Place> places(points.samples.size());
  tbb::parallel_for(std::size_t{0}, (places.size() + 4095) / 4096, [&](std::size_t piece) {
    for (std::size_t i = piece * 4096; i < std::min(places.size(), (piece + 1) * 4096); ++i) {
      const Coord voxel = Coord::round(index_of(points, transform, i));
      places[i] = {voxel & ~7, PointDataTree::LeafNodeType::coordToOffset(voxel), i};
    }
  });
  tbb::parallel_sort(places.begin(), places.end());
  return places;
}

/// Of a node, `voxels` wide, each place where points lie; leaves come in the order of their places.
std::size_t count_nodes(const std::vector<Place>& places, std::int32_t voxels) {
  std::vector<Coord> nodes;
  for (const Place& p : places) {
    const Coord node = p.leaf & ~(voxels - 1);
    if (nodes.empty() || nodes.back() != node) nodes.push_back(node);
  }
  std::sort(nodes.begin(), nodes.end());
  return static_cast<std::size_t>(std::unique(nodes.begin(), nodes.end()) - nodes.begin());
}

/// Points thinly spread over small voxels have a leaf and its nodes each to themselves.
void check_memory(const std::vector<Place>& places, std::size_t columns, double voxel, double usual,
                  std::uint64_t most) {
  using Leaf = PointDataTree::LeafNodeType;
  using Lower = PointDataTree::RootNodeType::ChildNodeType::ChildNodeType;
  using Upper = PointDataTree::RootNodeType::ChildNodeType;
  constexpr std::size_t kArray = 200;  // an attribute's, beside its values
  const auto leaves =
      static_cast<double>(count_nodes(places, Leaf::DIM) * (sizeof(Leaf) + 4 * Leaf::SIZE + kArray * (columns + 2)));
  const double bytes = leaves + static_cast<double>(count_nodes(places, Lower::DIM) * sizeof(Lower)) +
                       static_cast<double>(count_nodes(places, Upper::DIM) * sizeof(Upper)) +
                       12.0 * static_cast<double>(places.size() * (columns + 1));
  if (most == 0 || bytes <= static_cast<double>(most)) return;
  throw Error(
      ExitCode::budget,
      fmt::format("voxels of {:g} leave the points so far apart that the grid needs about {:.0f} MB, where {:.0f} "
                  "MB are allowed; a --voxelsize of {:g} holds eight points a voxel",
                  voxel, bytes / 1e6, static_cast<double>(most) / 1e6, usual));
}

void fill_column(points::AttributeArray& array, const PointColumn& column, const Place* places, Index count) {
  const auto scaled = [&](std::size_t k, Index i) { return column.from[k][places[i].row] / column.scale; };
  switch (column.kind) {
    case PointColumn::Kind::vector: {
      AttributeWriteHandle<Vec3s> out(array);
      for (Index i = 0; i < count; ++i) out.set(i, Vec3s(scaled(0, i), scaled(1, i), scaled(2, i)));
      return;
    }
    case PointColumn::Kind::int32: {
      AttributeWriteHandle<std::int32_t> out(array);
      for (Index i = 0; i < count; ++i) out.set(i, static_cast<std::int32_t>(std::llrint(scaled(0, i))));
      return;
    }
    case PointColumn::Kind::float32: {
      AttributeWriteHandle<float> out(array);
      for (Index i = 0; i < count; ++i) out.set(i, scaled(0, i));
      return;
    }
  }
}

NamePair type_of(PointColumn::Kind kind) {
  if (kind == PointColumn::Kind::vector) return TypedAttributeArray<Vec3s>::attributeType();
  if (kind == PointColumn::Kind::int32) return TypedAttributeArray<std::int32_t>::attributeType();
  return TypedAttributeArray<float>::attributeType();
}

/// What the arrays become; P is not among them. Throws Error(usage) for a name given twice.
std::vector<PointColumn> point_columns(const PointArrays& points) {
  using Kind = PointColumn::Kind;
  const SampleBatch& s = points.samples;
  std::vector<PointColumn> columns;
  if (!s.nx.empty()) columns.push_back({"N", Kind::vector, {s.nx.data(), s.ny.data(), s.nz.data()}, 1, {}});
  if (!s.radius.empty()) columns.push_back({"pscale", Kind::float32, {s.radius.data()}, 1, {}});
  if (!s.quality.empty()) columns.push_back({"quality", Kind::float32, {s.quality.data()}, 1, {}});
  const AttributeLayout& layout = points.layout;
  const auto data = [&](std::size_t i) { return s.attributes[i].data(); };
  const auto red = find_attribute(layout, "red"), green = find_attribute(layout, "green"),
             blue = find_attribute(layout, "blue");
  const bool coloured =
      red && green && blue && layout[*red].type == layout[*green].type && layout[*red].type == layout[*blue].type;
  if (coloured) {
    const ScalarType type = layout[*red].type;
    columns.push_back(
        {"Cd", Kind::vector, {data(*red), data(*green), data(*blue)}, full_range(type), std::string(ply_name(type))});
  }
  for (std::size_t i = 0; i < layout.size(); ++i) {
    if (coloured && (i == *red || i == *green || i == *blue)) continue;
    const ScalarType type = layout[i].type;
    const bool alpha = layout[i].name == "alpha";
    // A float holds every uint32 the arrays can tell apart.
    const bool whole = !is_real(type) && !alpha && type != ScalarType::uint32;
    columns.push_back({alpha ? "Alpha" : layout[i].name,
                       whole ? Kind::int32 : Kind::float32,
                       {data(i)},
                       alpha ? full_range(type) : 1,
                       std::string(ply_name(type))});
  }
  std::set<std::string> names{"P"};
  for (const PointColumn& c : columns) {
    if (!names.insert(c.name).second)
      throw Error(ExitCode::usage, fmt::format("two attributes are called {}; rename one", c.name));
  }
  return columns;
}

/// The voxel's edge: a power of two, so that floats stay what they are; with `wanted` 0 some eight points a voxel were
/// they spread over a surface.
double point_voxel(const SampleBatch& s, double wanted) {
  // OpenVDB takes smaller voxels for a singular transform.
  constexpr double kSmallest = 0x1p-16;
  if (wanted > 0) return std::max(kSmallest, std::exp2(std::floor(std::log2(wanted))));
  double diagonal = 0;
  for (const auto* axis : {&s.x, &s.y, &s.z}) {
    const auto [low, high] = std::minmax_element(axis->begin(), axis->end());
    diagonal = std::hypot(diagonal, *high - *low);
  }
  if (!(diagonal > 0)) return 1;
  const double edge = diagonal * std::sqrt(8 / static_cast<double>(s.size()));
  return std::max(kSmallest, std::exp2(std::round(std::log2(edge) - 0.5)));
}

/// A transform of a power-of-two voxel, offset by whole voxels where the numbers of voxels would not fit.
math::Transform::Ptr point_transform(const PointArrays& points, double voxel) {
  // Voxels are counted from the origin as long as their numbers stay well inside an int.
  constexpr double kLargest = 1 << 29;
  const SampleBatch& s = points.samples;
  double farthest = 0;
  Vec3d offset(0.0);
  const std::array<const std::vector<double>*, 3> axes{&s.x, &s.y, &s.z};
  for (int k = 0; k < 3; ++k) {
    const auto [low, high] =
        std::minmax_element(axes[static_cast<std::size_t>(k)]->begin(), axes[static_cast<std::size_t>(k)]->end());
    farthest = std::max({farthest, -*low / voxel, *high / voxel});
    offset[k] = voxel * std::round((*low + 0.5 * (*high - *low)) / voxel);
    if ((*high - *low) / voxel > kLargest) {
      throw Error(ExitCode::usage,
                  fmt::format("--voxelsize {:g}: too small for a cloud that spans {:g}", voxel, *high - *low));
    }
  }
  auto transform = math::Transform::createLinearTransform(voxel);
  if (farthest > kLargest) transform->postTranslate(offset);
  return transform;
}

/// What the leaves are filled from.
struct PointSourceArrays {
  const PointArrays& points;
  const math::Transform& transform;
  std::vector<PointColumn> columns;
  AttributeSet::Descriptor::Ptr descriptor;  ///< of P and the columns
};

/// Points in the order of their places, attribute by attribute, and where each voxel's points end.
void fill_leaf(const PointSourceArrays& from, std::span<const Place> places, PointDataTree::LeafNodeType& leaf) {
  using Leaf = PointDataTree::LeafNodeType;
  const auto count = static_cast<Index>(places.size());
  leaf.replaceAttributeSet(new AttributeSet(from.descriptor, count), /*allowMismatchingDescriptors=*/true);
  std::vector<Leaf::ValueType> offsets(Leaf::SIZE);
  for (Index v = 0, i = 0; v < Leaf::SIZE; ++v) {
    while (i < count && places[i].voxel == v) ++i;
    offsets[v] = i;
  }
  leaf.setOffsets(offsets);
  AttributeWriteHandle<Vec3s> position(leaf.attributeArray(0));
  for (Index i = 0; i < count; ++i) {
    const Vec3d inside =
        index_of(from.points, from.transform, places[i].row) - leaf.offsetToGlobalCoord(places[i].voxel).asVec3d();
    position.set(i, Vec3s(inside));
  }
  for (std::size_t c = 0; c < from.columns.size(); ++c)
    fill_column(leaf.attributeArray(c + 1), from.columns[c], places.data(), count);
}

[[noreturn]] void wrong_points(const std::string& message) {
  throw Error(ExitCode::usage, message);
}

void require_sound(const PointArrays& points, const PointVolumeSettings& settings) {
  const SampleBatch& s = points.samples;
  if (settings.name.empty()) wrong_points("--name must be a word");
  if (!(settings.voxel >= 0 && std::isfinite(settings.voxel)))
    wrong_points("--voxelsize must be a positive length, or 0");
  if (s.size() == 0) throw Error(ExitCode::empty, "there are no points to write");
  bool equal = s.y.size() == s.size() && s.z.size() == s.size() && s.attributes.size() == points.layout.size() &&
               s.ny.size() == s.nx.size() && s.nz.size() == s.nx.size();
  for (const auto* a : {&s.nx, &s.radius, &s.quality}) equal = equal && (a->empty() || a->size() == s.size());
  for (const auto& a : s.attributes) equal = equal && a.size() == s.size();
  if (!equal) wrong_points("the points' arrays differ in length");
  for (std::size_t i = 0; i < s.size(); ++i) {
    if (std::isfinite(s.x[i]) && std::isfinite(s.y[i]) && std::isfinite(s.z[i])) continue;
    throw Error(ExitCode::unreadable,
                fmt::format("row {} (counted from 0) has a coordinate that is not finite; remove it first", i));
  }
}

}  // namespace

PointDataGrid::Ptr point_grid(const PointArrays& points, double voxel, std::uint64_t most_bytes) {
  std::vector<PointColumn> columns = point_columns(points);
  const math::Transform::Ptr transform = point_transform(points, point_voxel(points.samples, voxel));
  AttributeSet::Descriptor::Ptr descriptor =
      AttributeSet::Descriptor::create(TypedAttributeArray<Vec3s>::attributeType());
  for (const PointColumn& c : columns) descriptor = descriptor->duplicateAppend(c.name, type_of(c.kind));
  const PointSourceArrays from{points, *transform, std::move(columns), std::move(descriptor)};

  const std::vector<Place> places = sorted_places(points, *transform);
  check_memory(places, from.columns.size(), transform->voxelSize()[0], point_voxel(points.samples, 0),
               most_bytes > 0 ? most_bytes : machine_memory());
  struct Run {
    PointDataTree::LeafNodeType* leaf;
    std::size_t begin, end;
  };
  auto grid = PointDataGrid::create();
  std::vector<Run> runs;
  for (std::size_t begin = 0, end = 0; begin < places.size(); begin = end) {
    while (end < places.size() && places[end].leaf == places[begin].leaf) ++end;
    runs.push_back({grid->tree().touchLeaf(places[begin].leaf), begin, end});
  }
  tbb::parallel_for(std::size_t{0}, runs.size(), [&](std::size_t r) {
    fill_leaf(from, {&places[runs[r].begin], runs[r].end - runs[r].begin}, *runs[r].leaf);
  });
  grid->setTransform(transform);
  for (const PointColumn& c : from.columns)
    if (!c.types.empty()) grid->insertMeta(kTypeMetadata + c.name, StringMetadata(c.types));
  return grid;
}

}  // namespace lamina::volume

namespace lamina {

PointVolumeStats write_point_volume(const PointArrays& points, const PointVolumeSettings& settings,
                                    const std::string& path, const RunContext& run) {
  volume::require_sound(points, settings);
  openvdb::initialize();
  PointVolumeStats stats;
  with_threads(run.threads, [&] {
    const auto grid = volume::point_grid(points, settings.voxel, run.max_memory);
    stats.voxel = grid->voxelSize()[0];
    volume::label(*grid, settings.name, false);
    stats.points = points.samples.size();
    stats.voxels = grid->activeVoxelCount();
    stats.bytes = volume::write_vdb({grid}, path);
  });
  return stats;
}

}  // namespace lamina
