#include "vdb/vdb_file.h"

#include <fmt/format.h>
#include <openvdb/points/AttributeArray.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <set>
#include <utility>
#include <vector>

#include "base/number.h"
#include "lamina/error.h"
#include "vdb/points_grid.h"

// Compressed pieces are unpacked here already: OpenVDB loses memory when it finds out in the middle of a grid.

namespace lamina::volume {
namespace {

using openvdb::points::AttributeArray;

/// An attribute's array in one leaf.
struct Array {
  std::uint64_t bytes = 0;     ///< as it lies in its page, or in the file
  std::uint64_t expected = 0;  ///< of its values
  bool uniform = false, paged = false;
};

std::uint32_t bytes_of_value(const std::string& type, const std::string& codec) {
  if (!AttributeArray::isRegistered({type, codec})) wrong(fmt::format("its points have values of type {}", type));
  return AttributeArray::create({type, codec}, 1, 1)->storageTypeSize();
}

/// Returns what a value of each attribute takes.
std::vector<std::uint32_t> check_descriptor(Walker& w) {
  std::vector<std::uint32_t> out;
  const auto count = w.number<std::uint64_t>();
  // Two empty texts each at least.
  if (count > w.left() / 8) wrong("a list of attributes does not fit into it");
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::string type = w.text(), codec = w.text();
    out.push_back(bytes_of_value(type, codec));
  }
  std::set<std::uint64_t> places;
  std::set<std::string> names;
  for (std::uint64_t i = 0; i < count; ++i) {
    names.insert(w.text());
    if (const auto place = w.number<std::uint64_t>(); place < count) places.insert(place);
  }
  if (places.size() != count || names.size() != count) wrong("a list of attributes contradicts itself");
  const auto groups = w.number<std::uint64_t>();
  if (groups > w.left() / 12) wrong("a list of groups does not fit into it");
  for (std::uint64_t i = 0; i < groups; ++i) {
    w.text();
    w.skip(sizeof(std::uint64_t));
  }
  check_metadata(w);
  return out;
}

Array check_array(Walker& w, std::uint32_t value_bytes) {
  enum Written : std::uint8_t { kStrided = 1, kUniform = 2, kPaged = 8 };
  constexpr std::uint64_t kCounted = sizeof(std::int16_t) + sizeof(std::uint32_t);  // flags and size, not the values
  const auto bytes = w.number<std::uint64_t>();
  if (bytes < kCounted) wrong("an array of points is too short");
  const auto flags = w.number<std::uint8_t>();
  const auto written = w.number<std::uint8_t>();
  if (flags >= AttributeArray::PARTIALREAD || written >= 0x10) wrong("an array of points is of no known kind");
  const auto size = w.number<std::uint32_t>();
  const std::uint64_t stride = (written & kStrided) != 0 ? w.number<std::uint32_t>() : 1;
  if (size == 0 || stride == 0) wrong("an array of points is empty");
  Array out;
  out.bytes = bytes - kCounted;
  out.uniform = (written & kUniform) != 0;
  out.paged = (written & kPaged) != 0;
  const bool constant = (flags & AttributeArray::CONSTANTSTRIDE) != 0;
  // OpenVDB counts values with 32 bits. What is no stride is the number of all values.
  const std::uint64_t values = constant ? size * stride : stride;
  if (values > std::numeric_limits<std::uint32_t>::max()) wrong("an array of points is too long");
  out.expected = (out.uniform ? 1 : values) * value_bytes;
  return out;
}

struct Page {
  std::int32_t packed = 0;  ///< less than 0: not compressed
  std::int32_t bytes = 0;
};

/// Arrays of one attribute lie one behind another in pages. Reads what the pages hold; each must be used up.
std::vector<Page> check_page_sizes(Walker& w, const std::vector<std::vector<Array>>& leaves, std::size_t attribute) {
  std::vector<Page> pages;
  std::uint64_t left = 0;
  for (const std::vector<Array>& arrays : leaves) {
    if (attribute >= arrays.size() || !arrays[attribute].paged) continue;
    if (left == 0) {
      Page page;
      page.packed = w.number<std::int32_t>();
      if (page.packed == 0 || page.packed == std::numeric_limits<std::int32_t>::min())
        wrong("a page of points is empty");
      page.bytes = page.packed > 0 ? w.number<std::int32_t>() : -page.packed;
      if (page.bytes <= 0) wrong("a page of points is empty");
      pages.push_back(page);
      left = static_cast<std::uint64_t>(page.bytes);
    }
    const Array& array = arrays[attribute];
    if (array.bytes != array.expected || array.bytes > left || array.bytes == 0)
      wrong("an array of points does not fit into its page");
    left -= array.bytes;
  }
  if (left != 0) wrong("a page of points holds more than its arrays");
  return pages;
}

void check_page(Walker& w, const Page& page) {
  if (page.packed < 0) return w.skip(static_cast<std::uint64_t>(page.bytes));
  const std::uint64_t unpacked = unpack_blosc(w, static_cast<std::uint64_t>(page.packed));
  if (!holds(unpacked, static_cast<std::uint64_t>(page.bytes))) wrong("a page of points is damaged");
}

/// An array that lies in the file by itself.
void check_single(Walker& w, const Array& array) {
  if (!array.uniform && w.number<std::uint8_t>() == 1) {
    if (!holds(unpack_blosc(w, array.bytes), array.expected)) wrong("an array of points is damaged");
    return;
  }
  if (array.bytes != array.expected) wrong("an array of points has a wrong size");
  w.skip(array.bytes);
}

/// The points' offsets by voxel.
void check_voxels(Walker& w) {
  constexpr std::uint64_t kMaskBytes = 64, kVoxelBytes = 512 * sizeof(std::uint32_t);
  constexpr std::uint16_t kNotCompressed = 0xFFFF;
  w.skip(kMaskBytes);
  const auto packed = w.number<std::uint16_t>();
  if (packed == kNotCompressed) return w.skip(kVoxelBytes);
  if (unpack_blosc(w, packed) != kVoxelBytes) wrong("a leaf of points is damaged");
}

std::vector<std::vector<Array>> check_arrays(Walker& w, std::uint64_t leaves) {
  std::vector<std::vector<Array>> out;
  std::vector<std::uint32_t> value_bytes;
  bool shared = false;  // by all leaves from the first on that says so
  for (std::uint64_t leaf = 0; leaf < leaves; ++leaf) {
    if (!shared) {
      const auto header = w.number<std::uint8_t>();
      if (header > 3) wrong("a leaf of points is of no known kind");
      value_bytes = check_descriptor(w);
      shared = (header & 1U) != 0;
      if ((header & 2U) != 0) {
        const auto more = w.number<std::uint64_t>();
        if (more > w.left()) throw std::ios::failure("the end");
        w.skip(more);
      }
    }
    std::vector<Array>& arrays = out.emplace_back();
    for (const std::uint32_t bytes : value_bytes) arrays.push_back(check_array(w, bytes));
  }
  return out;
}

}  // namespace

void check_points(Walker& w, std::uint64_t leaves, std::uint32_t version) {
  constexpr std::uint32_t kPasses = 224;
  if (version < kPasses) wrong(fmt::format("it holds points in a file of version {}; save it anew", version));
  const auto passes = w.number<std::uint16_t>();
  if (passes < 4 || passes % 2 != 0) wrong("its points come in a wrong number of passes");
  const std::size_t attributes = (passes - 4U) / 2;
  w.skip(leaves * sizeof(std::uint16_t));
  const std::vector<std::vector<Array>> arrays = check_arrays(w, leaves);
  std::vector<std::vector<Page>> pages;
  for (const std::vector<Array>& leaf : arrays)
    if (leaf.size() > attributes) wrong("a leaf of points has more attributes than there are passes");
  for (std::size_t a = 0; a < attributes; ++a) pages.push_back(check_page_sizes(w, arrays, a));
  for (std::uint64_t leaf = 0; leaf < leaves; ++leaf) check_voxels(w);
  for (std::size_t a = 0; a < attributes; ++a) {
    // A page is read when its first array is wanted.
    auto page = pages[a].begin();
    std::uint64_t left = 0;
    for (const std::vector<Array>& leaf : arrays) {
      if (a >= leaf.size()) continue;
      if (!leaf[a].paged) {
        check_single(w, leaf[a]);
        continue;
      }
      if (left == 0) {
        left = static_cast<std::uint64_t>(page->bytes);
        check_page(w, *page++);
      }
      left -= leaf[a].bytes;
    }
  }
}

}  // namespace lamina::volume

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
