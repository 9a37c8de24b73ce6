#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "base/scalar_type.h"
#include "lamina/error.h"
#include "vdb/points_grid.h"
#include "vdb/vdb_file.h"

namespace lamina {
namespace {

using namespace openvdb;
using points::AttributeArray;
using points::AttributeHandle;
using points::PointDataGrid;
using Leaf = points::PointDataTree::LeafNodeType;

PointDataGrid::Ptr choose(const std::string& path, const GridPtrVec& grids, const std::string& name) {
  for (const auto& grid : grids) {
    if (!name.empty() && grid->getName() != name) continue;
    if (auto found = gridPtrCast<PointDataGrid>(grid)) return found;
    if (!name.empty()) break;
  }
  throw Error(ExitCode::unreadable,
              fmt::format("{}: holds no points{}; it holds {}", path, name.empty() ? std::string() : " called " + name,
                          volume::list_of(grids)));
}

/// Where an attribute of the grid goes.
struct Target {
  std::string name;  ///< in the grid
  std::array<std::vector<float>*, 3> to{};
  float scale = 1;
  bool whole = false;  ///< integers that were divided by their range
};

template <class T, class Put>
bool read_as(const AttributeArray& array, Index count, const Put& put) {
  if (!array.hasValueType<T>()) return false;
  const AttributeHandle<T> handle(array);
  for (Index i = 0; i < count; ++i) put(i, handle.get(i));
  return true;
}

bool is_scalar(const std::string& type) {
  static const std::array<const char*, 7> known{"float", "double", "int32", "int64", "int16", "int8", "bool"};
  return std::find(known.begin(), known.end(), type) != known.end();
}
bool is_vector(const std::string& type) {
  return type == "vec3s" || type == "vec3d" || type == "vec3i";
}

void read_column(const AttributeArray& array, Index count, const Target& t) {
  const auto value = [&](auto v) {
    const float scaled = static_cast<float>(v) * t.scale;
    return t.whole ? std::round(scaled) : scaled;
  };
  const auto scalar = [&](Index, auto v) { t.to[0]->push_back(value(v)); };
  const auto vector = [&](Index, const auto& v) {
    for (int k = 0; k < 3; ++k) t.to[static_cast<std::size_t>(k)]->push_back(value(v[k]));
  };
  read_as<float>(array, count, scalar) || read_as<double>(array, count, scalar) ||
      read_as<std::int32_t>(array, count, scalar) || read_as<std::int64_t>(array, count, scalar) ||
      read_as<std::int16_t>(array, count, scalar) || read_as<std::int8_t>(array, count, scalar) ||
      read_as<bool>(array, count, scalar) || read_as<Vec3s>(array, count, vector) ||
      read_as<Vec3d>(array, count, vector) || read_as<Vec3i>(array, count, vector);
}

void read_positions(const Leaf& leaf, const AttributeArray& array, const math::Transform& transform, SampleBatch& out) {
  std::vector<Coord> voxels(leaf.getLastValue());
  Index from = 0;
  for (Index v = 0; v < Leaf::SIZE; ++v) {
    const Index to = leaf.getValue(v);
    for (Index i = from; i < to; ++i) voxels[i] = leaf.offsetToGlobalCoord(v);
    from = to;
  }
  const auto put = [&](Index i, const auto& inside) {
    const Vec3d world = transform.indexToWorld(voxels[i].asVec3d() + Vec3d(inside));
    out.x.push_back(world[0]);
    out.y.push_back(world[1]);
    out.z.push_back(world[2]);
  };
  const auto count = static_cast<Index>(voxels.size());
  read_as<Vec3s>(array, count, put) || read_as<Vec3d>(array, count, put);
}

/// Offsets that point outside of their arrays would read what is not there. An array of one value for all takes no room
/// in the file, whatever number of points it promises: `most` bounds that.
void check_leaf(const Leaf& leaf, std::uint64_t most, const std::string& path) {
  Index from = 0;
  for (Index v = 0; v < Leaf::SIZE; ++v) {
    const Index to = leaf.getValue(v);
    if (to < from) throw Error(ExitCode::unreadable, path + ": the points grid's offsets are not in order");
    from = to;
  }
  if (from > most) throw Error(ExitCode::unreadable, path + ": the points grid promises more points than it can hold");
  for (std::size_t a = 0; a < leaf.attributeSet().size(); ++a) {
    const AttributeArray& array = leaf.constAttributeArray(a);
    if ((array.size() < from && array.stride() == 1) || (array.dataSize() < from && !array.isUniform()))
      throw Error(ExitCode::unreadable, path + ": the points grid's arrays are shorter than its offsets say");
  }
}

std::optional<ScalarType> type_from(const PointDataGrid& grid, const std::string& name) {
  const auto text = grid.getMetadata<StringMetadata>(volume::kTypeMetadata + name);
  return text == nullptr ? std::nullopt : ply_type(text->value());
}

/// Decides which arrays are read and where they go. The cloud's arrays must not move any more afterwards.
std::vector<Target> plan(const PointDataGrid& grid, const Leaf& leaf, PointVolume& out) {
  const auto& descriptor = leaf.attributeSet().descriptor();
  std::map<std::string, std::size_t> names(descriptor.map().begin(), descriptor.map().end());
  SampleBatch& s = out.points.samples;
  std::vector<Target> targets;
  std::vector<std::pair<std::size_t, AttributeSpec>> columns;  // of target, in the order of the layout
  const auto has = [&](const char* name) { return names.count(name) != 0; };
  for (const auto& [name, position] : names) {
    if (name == "P") continue;
    const std::string type = descriptor.type(position).first;
    const bool single = leaf.constAttributeArray(position).stride() == 1;
    const bool group = descriptor.type(position).second == "grp";
    if (!single || group || !(is_scalar(type) || is_vector(type))) {
      out.skipped.push_back(name);
    } else if (name == "N" && is_vector(type)) {
      targets.push_back({name, {&s.nx, &s.ny, &s.nz}});
    } else if (is_scalar(type) && (name == "pscale" || (name == "radius" && !has("pscale")))) {
      targets.push_back({name, {&s.radius}});
    } else if (is_scalar(type) && (name == "quality" || (name == "confidence" && !has("quality")))) {
      targets.push_back({name, {&s.quality}});
    } else {
      const bool vector = is_vector(type);
      const bool real = type == "float" || type == "double" || type == "vec3s" || type == "vec3d";
      const ScalarType as = type_from(grid, name).value_or(real ? ScalarType::float32 : ScalarType::int32);
      const bool colour = vector && name == "Cd", alpha = name == "Alpha";
      const float scale = colour || alpha ? volume::full_range(as) : 1.0F;
      targets.push_back({name, {}, scale, scale > 1});
      static const std::array<const char*, 3> kColour{"red", "green", "blue"}, kAxis{"_x", "_y", "_z"};
      for (std::size_t k = 0; k < (vector ? 3U : 1U); ++k) {
        const std::string called = colour ? kColour[k] : vector ? name + kAxis[k] : alpha ? "alpha" : name;
        columns.emplace_back(targets.size() - 1, AttributeSpec{called, as});
      }
    }
  }
  s.attributes.resize(columns.size());
  std::size_t last = targets.size(), k = 0;
  for (std::size_t c = 0; c < columns.size(); ++c) {
    k = columns[c].first == last ? k + 1 : 0;
    last = columns[c].first;
    targets[last].to[k] = &s.attributes[c];
    out.points.layout.push_back(columns[c].second);
  }
  return targets;
}

}  // namespace

PointVolume read_point_volume(const std::string& path, const std::string& name) {
  const volume::VdbFile file = volume::read_vdb(path);
  const PointDataGrid::Ptr grid = choose(path, file.grids, name);
  const auto refuse = [&](const std::string& what) {
    throw Error(ExitCode::unreadable, fmt::format("{}: points grid {} {}", path, grid->getName(), what));
  };
  if (!grid->transform().isLinear()) refuse("has a frustum (perspective) transform; save it with a linear one");
  PointVolume out;
  const auto first = grid->tree().cbeginLeaf();
  if (!first) refuse("holds no points");
  constexpr std::uint64_t kMostPerByte = 64;
  const std::vector<Target> targets = plan(*grid, *first, out);
  for (auto leaf = grid->tree().cbeginLeaf(); leaf; ++leaf) {
    check_leaf(*leaf, kMostPerByte * file.bytes - out.points.samples.size(), path);
    const std::size_t at = leaf->attributeSet().find("P");
    if (at == points::AttributeSet::INVALID_POS) refuse("has no positions (P)");
    const AttributeArray& positions = leaf->constAttributeArray(at);
    if (!positions.hasValueType<Vec3s>() && !positions.hasValueType<Vec3d>())
      refuse("has positions (P) that are no vectors");
    read_positions(*leaf, positions, grid->transform(), out.points.samples);
    const Index count = leaf->getLastValue();
    for (const Target& t : targets) {
      const std::size_t column = leaf->attributeSet().find(t.name);
      if (column == points::AttributeSet::INVALID_POS) refuse(fmt::format("lacks {} in some of its leaves", t.name));
      const std::size_t before = t.to[0]->size();
      read_column(leaf->constAttributeArray(column), count, t);
      if (t.to[0]->size() != before + count) refuse(fmt::format("changes the type of {} between leaves", t.name));
    }
  }
  if (out.points.samples.size() == 0) refuse("holds no points");
  return out;
}

}  // namespace lamina
