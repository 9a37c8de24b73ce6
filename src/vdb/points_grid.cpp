#include "vdb/points_grid.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>

#include "base/run.h"
#include "base/scalar_type.h"
#include "lamina/error.h"
#include "vdb/full_range.h"

namespace lamina::volume {
namespace {

using namespace openvdb;
using points::AttributeSet;
using points::AttributeWriteHandle;
using points::PointDataGrid;
using points::PointDataTree;
using points::TypedAttributeArray;

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

}  // namespace

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

math::Transform::Ptr point_transform(const PointArrays& points, double voxel) {
  // Voxels are counted from the origin as long as their numbers stay well inside an int.
  constexpr double kLargest = 1 << 29;
  const SampleBatch& s = points.samples;
  double reach = 0;
  Vec3d offset(0.0);
  const std::array<const std::vector<double>*, 3> axes{&s.x, &s.y, &s.z};
  for (int k = 0; k < 3; ++k) {
    const auto [low, high] =
        std::minmax_element(axes[static_cast<std::size_t>(k)]->begin(), axes[static_cast<std::size_t>(k)]->end());
    reach = std::max({reach, -*low / voxel, *high / voxel});
    offset[k] = voxel * std::round((*low + 0.5 * (*high - *low)) / voxel);
    if ((*high - *low) / voxel > kLargest) {
      throw Error(ExitCode::usage,
                  fmt::format("--voxelsize {:g}: too small for a cloud that spans {:g}", voxel, *high - *low));
    }
  }
  auto transform = math::Transform::createLinearTransform(voxel);
  if (reach > kLargest) transform->postTranslate(offset);
  return transform;
}

PointDataGrid::Ptr point_grid(const PointArrays& points, const std::vector<PointColumn>& columns,
                              const math::Transform::Ptr& transform, std::uint64_t most_bytes) {
  using Leaf = PointDataTree::LeafNodeType;
  AttributeSet::Descriptor::Ptr descriptor =
      AttributeSet::Descriptor::create(TypedAttributeArray<Vec3s>::attributeType());
  for (const PointColumn& c : columns) descriptor = descriptor->duplicateAppend(c.name, type_of(c.kind));

  const std::vector<Place> places = sorted_places(points, *transform);
  check_memory(places, columns.size(), transform->voxelSize()[0], point_voxel(points.samples, 0),
               most_bytes > 0 ? most_bytes : machine_memory());
  struct Run {
    Leaf* leaf;
    std::size_t begin, end;
  };
  auto grid = PointDataGrid::create();
  std::vector<Run> runs;
  for (std::size_t begin = 0, end = 0; begin < places.size(); begin = end) {
    while (end < places.size() && places[end].leaf == places[begin].leaf) ++end;
    runs.push_back({grid->tree().touchLeaf(places[begin].leaf), begin, end});
  }
  tbb::parallel_for(std::size_t{0}, runs.size(), [&](std::size_t r) {
    const auto [leaf, begin, end] = runs[r];
    const auto count = static_cast<Index>(end - begin);
    const Place* const first = &places[begin];
    leaf->replaceAttributeSet(new AttributeSet(descriptor, count), /*allowMismatchingDescriptors=*/true);
    std::vector<Leaf::ValueType> offsets(Leaf::SIZE);
    for (Index v = 0, i = 0; v < Leaf::SIZE; ++v) {
      while (i < count && first[i].voxel == v) ++i;
      offsets[v] = i;
    }
    leaf->setOffsets(offsets);
    AttributeWriteHandle<Vec3s> position(leaf->attributeArray(0));
    for (Index i = 0; i < count; ++i) {
      const Vec3d inside =
          index_of(points, *transform, first[i].row) - leaf->offsetToGlobalCoord(first[i].voxel).asVec3d();
      position.set(i, Vec3s(inside));
    }
    for (std::size_t c = 0; c < columns.size(); ++c) fill_column(leaf->attributeArray(c + 1), columns[c], first, count);
  });
  grid->setTransform(transform);
  for (const PointColumn& c : columns)
    if (!c.types.empty()) grid->insertMeta(kTypeMetadata + c.name, StringMetadata(c.types));
  return grid;
}

}  // namespace lamina::volume
