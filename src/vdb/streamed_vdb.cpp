#include "vdb/streamed_vdb.h"

#include <fmt/format.h>
#include <openvdb/io/Archive.h>
#include <openvdb/io/Compression.h>
#include <openvdb/io/GridDescriptor.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <numeric>
#include <sstream>
#include <string_view>
#include <tuple>

#include "lamina/error.h"
#include "vdb/content_tag.h"

namespace lamina::volume {
namespace {

using namespace openvdb;

constexpr std::uint32_t kCompression = io::COMPRESS_BLOSC | io::COMPRESS_ACTIVE_MASK;
constexpr std::int32_t kLower = 16, kUpper = 32;  ///< leaves in a lower, lower nodes in an upper node, along an axis

/// What OpenVDB writes before its grids is behind protected doors.
struct Archive : io::Archive {
  using io::Archive::setGridCompression;
  using io::Archive::writeHeader;
};

template <class T>
void put(std::ostream& os, const T& value) {
  os.write(reinterpret_cast<const char*>(&value), sizeof value);
}

template <class Leaf, class Value>
PackedLeaf pack_any(const Leaf& leaf, const Value& background, bool half) {
  PackedLeaf out;
  out.origin = leaf.origin();
  out.active = static_cast<std::uint32_t>(leaf.onVoxelCount());
  leaf.evalActiveBoundingBox(out.box);
  std::ostringstream os(std::ios::binary);
  io::setDataCompression(os, kCompression);
  io::setGridBackgroundValuePtr(os, &background);
  leaf.writeBuffers(os, half);
  out.bytes = std::move(os).str();
  return out;
}

/// The tree's own order: nodes by place, and inside a node by x, y, z.
using Key = std::array<std::int32_t, 9>;
Key key_of(const LeafVotes& v) {
  Key key{};
  for (std::size_t k = 0; k < 3; ++k) {
    key[k] = v.leaf[k] >> 9;
    key[3 + k] = v.leaf[k] >> 4;
    key[6 + k] = v.leaf[k];
  }
  return key;
}

template <class Mask, int kSide>
Index slot_in(const Coord& local) {
  return static_cast<Index>((local[0] * kSide + local[1]) * kSide + local[2]);
}

}  // namespace

std::array<std::int8_t, 6> face_votes(const FloatTree::LeafNodeType& leaf) {
  // An active voxel's neighbour beyond the leaf must be on its side; the others only guess.
  std::array<int, 6> votes{};
  const auto count = [&](std::size_t face, Index at) {
    votes[face] += (leaf.isValueOn(at) ? 8 : 1) * (leaf.getValue(at) < 0 ? -1 : 1);
  };
  for (Index a = 0; a < 8; ++a) {
    for (Index b = 0; b < 8; ++b) {
      count(0, a << 3 | b), count(1, 7 << 6 | a << 3 | b);
      count(2, a << 6 | b), count(3, a << 6 | 7 << 3 | b);
      count(4, a << 6 | b << 3), count(5, a << 6 | b << 3 | 7);
    }
  }
  std::array<std::int8_t, 6> out{};
  for (std::size_t f = 0; f < 6; ++f) out[f] = static_cast<std::int8_t>(std::clamp(votes[f] / 4, -16, 16));
  return out;
}

PackedLeaf pack(const FloatTree::LeafNodeType& leaf, float background, bool half) {
  PackedLeaf out = pack_any(leaf, background, half);
  out.faces = face_votes(leaf);
  return out;
}

PackedLeaf pack(const Vec3STree::LeafNodeType& leaf, bool half) {
  return pack_any(leaf, Vec3s(0), half);
}

StreamedVdb::StreamedVdb(std::string path, const std::string& tmp_dir) : path_(std::move(path)), spool_(tmp_dir) {
  std::error_code ec;
  if (std::filesystem::is_directory(path_, ec))
    throw Error(ExitCode::budget, fmt::format("{}: is a directory; name a file to write", path_));
  // An output that cannot be written is better known before the work.
  staged_ = StagedFile(path_);
  if (!staged_) fail("cannot be written");
}

void StreamedVdb::fail(const char* what) const {
  throw Error(ExitCode::budget, fmt::format("{}: {}: {}", path_, what, std::strerror(errno)));
}

std::size_t StreamedVdb::add_grid(const GridBase::Ptr& empty) {
  grids_.push_back({empty, {}, 0, {}});
  return grids_.size() - 1;
}

void StreamedVdb::add(std::size_t grid, const PackedLeaf& leaf) {
  Grid& g = grids_[grid];
  const auto* data = reinterpret_cast<const std::byte*>(leaf.bytes.data());
  Record r;
  for (int k = 0; k < 3; ++k) r.place.leaf[static_cast<std::size_t>(k)] = leaf.origin[k] >> 3;
  r.place.faces = leaf.faces;
  r.size = static_cast<std::uint32_t>(leaf.bytes.size());
  r.at = spool_.append({data, leaf.bytes.size()}, disk_);
  g.leaves.push_back(r);
  g.active += leaf.active;
  g.box.expand(leaf.box);
}

std::uint64_t StreamedVdb::leaves() const {
  std::uint64_t n = 0;
  for (const Grid& g : grids_) n += g.leaves.size();
  return n;
}

/// Where the records of the lower node (or with shift 9 of the upper node) end that begins at `begin`.
std::size_t StreamedVdb::end_of_node(const Grid& grid, std::size_t begin, int shift) {
  const auto& first = grid.leaves[begin].place.leaf;
  std::size_t end = begin;
  const auto same = [&](const LeafVotes& place) {
    for (std::size_t k = 0; k < 3; ++k)
      if (place.leaf[k] >> shift != first[k] >> shift) return false;
    return true;
  };
  while (end < grid.leaves.size() && same(grid.leaves[end].place)) ++end;
  return end;
}

/// Records in the file's order, out of a spool that holds runs of them in the order they came.
template <class Visit>
void StreamedVdb::visit_records(std::span<const Record> records, const Visit& visit) const {
  std::vector<std::uint32_t> order(records.size());
  std::iota(order.begin(), order.end(), 0U);
  std::sort(order.begin(), order.end(), [&](auto a, auto b) { return records[a].at < records[b].at; });
  std::size_t bytes = 0;
  for (const Record& r : records) bytes += r.size;
  const auto buffer = std::make_unique_for_overwrite<char[]>(bytes);
  std::vector<std::size_t> places(records.size());
  std::size_t at = 0;
  for (std::size_t i = 0; i < order.size();) {
    const std::uint64_t from = records[order[i]].at;
    const std::size_t to = at;
    for (; i < order.size() && records[order[i]].at == from + (at - to); ++i) {
      places[order[i]] = at;
      at += records[order[i]].size;
    }
    spool_.read(from, {reinterpret_cast<std::byte*>(buffer.get() + to), at - to});
  }
  for (std::size_t i = 0; i < records.size(); ++i) visit(std::string_view(buffer.get() + places[i], records[i].size));
}

/// A tree's skeleton: background, nodes with the masks of their children and the values of their tiles, leaf masks.
template <class Tree>
void StreamedVdb::write_topology(std::ostream& os, const Grid& grid) const {
  using Value = typename Tree::ValueType;
  using Upper = typename Tree::RootNodeType::ChildNodeType;
  using Lower = typename Upper::ChildNodeType;
  const bool half = grid.empty->saveFloatAsHalf();
  const Value background = static_cast<const openvdb::Grid<Tree>&>(*grid.empty).background();
  const bool has_signs = grid.empty->getGridClass() == GRID_LEVEL_SET;
  std::vector<LeafVotes> places;
  if (has_signs) {
    places.reserve(grid.leaves.size());
    for (const Record& r : grid.leaves) places.push_back(r.place);
  }
  const TileSigns signs(places);
  const Value inside = has_signs ? Value(-background) : background;

  Index uppers = 0;
  for (std::size_t i = 0; i < grid.leaves.size(); i = end_of_node(grid, i, 9)) ++uppers;

  put(os, std::int32_t{1});  // buffers
  put(os, half ? Value(io::truncateRealToHalf(background)) : background);
  io::setGridBackgroundValuePtr(os, &background);
  put(os, Index{0});  // tiles of the root
  put(os, uppers);
  for (std::size_t begin = 0; begin < grid.leaves.size();) {
    const std::size_t end = end_of_node(grid, begin, 9);
    const auto& first = grid.leaves[begin].place.leaf;
    const Coord upper(first[0] >> 9, first[1] >> 9, first[2] >> 9);
    for (int k = 0; k < 3; ++k) put(os, Int32{upper[k] * kUpper * kLower * 8});
    typename Upper::NodeMaskType children;
    for (std::size_t i = begin; i < end; i = end_of_node(grid, i, 4)) {
      const auto& l = grid.leaves[i].place.leaf;
      children.setOn(slot_in<Upper, kUpper>(Coord((l[0] >> 4) & 31, (l[1] >> 4) & 31, (l[2] >> 4) & 31)));
    }
    std::vector<Value> values(Upper::NUM_VALUES, zeroVal<Value>());
    for (Index v = 0; v < Upper::NUM_VALUES; ++v) {
      if (children.isOn(v)) continue;
      const auto n = static_cast<std::int32_t>(v);
      values[v] =
          signs.inside({upper[0] * kUpper + n / 1024, upper[1] * kUpper + n / 32 % 32, upper[2] * kUpper + n % 32})
              ? inside
              : background;
    }
    const typename Upper::NodeMaskType none;
    children.save(os);
    none.save(os);
    io::writeCompressedValues(os, values.data(), Upper::NUM_VALUES, none, children, half);
    for (std::size_t i = begin; i < end;) {
      const std::size_t last = end_of_node(grid, i, 4);
      const auto& l = grid.leaves[i].place.leaf;
      const std::uint8_t* const tiles = signs.inside_tiles({l[0] >> 4, l[1] >> 4, l[2] >> 4});
      typename Lower::NodeMaskType leaves;
      const typename Lower::NodeMaskType no_tiles;
      for (std::size_t j = i; j < last; ++j) {
        const auto& p = grid.leaves[j].place.leaf;
        leaves.setOn(slot_in<Lower, kLower>(Coord(p[0] & 15, p[1] & 15, p[2] & 15)));
      }
      std::vector<Value> slots(Lower::NUM_VALUES, zeroVal<Value>());
      for (Index v = 0; v < Lower::NUM_VALUES; ++v)
        if (leaves.isOff(v)) slots[v] = tiles != nullptr && tiles[v] != 0 ? inside : background;
      leaves.save(os);
      no_tiles.save(os);
      io::writeCompressedValues(os, slots.data(), Lower::NUM_VALUES, no_tiles, leaves, half);
      constexpr std::size_t kMaskBytes = 64;  // a leaf's record begins with its mask
      visit_records({&grid.leaves[i], last - i}, [&](std::string_view leaf) { os << leaf.substr(0, kMaskBytes); });
      i = last;
    }
    begin = end;
  }
  io::setGridBackgroundValuePtr(os, nullptr);
}

void StreamedVdb::write_buffers(std::ostream& os, const Grid& grid) const {
  std::string piece;  // small writes cost the stream and the kernel more
  for (std::size_t i = 0; i < grid.leaves.size();) {
    const std::size_t end = end_of_node(grid, i, 4);
    piece.clear();
    visit_records({&grid.leaves[i], end - i}, [&](std::string_view leaf) { piece += leaf; });
    os << piece;
    i = end;
  }
}

void StreamedVdb::write(std::ostream& os) {
  Archive archive;
  archive.setCompression(kCompression);
  archive.writeHeader(os, /*seekable=*/true);
  MetaMap().writeMeta(os);
  put(os, static_cast<std::int32_t>(grids_.size()));
  for (Grid& g : grids_) {
    std::sort(g.leaves.begin(), g.leaves.end(),
              [](const Record& a, const Record& b) { return key_of(a.place) < key_of(b.place); });
    const GridBase::Ptr grid = g.empty->copyGrid();
    grid->insertMeta(GridBase::META_FILE_VOXEL_COUNT, Int64Metadata(static_cast<Int64>(g.active)));
    if (!g.box.empty()) {
      grid->insertMeta(GridBase::META_FILE_BBOX_MIN, Vec3IMetadata(g.box.min().asVec3i()));
      grid->insertMeta(GridBase::META_FILE_BBOX_MAX, Vec3IMetadata(g.box.max().asVec3i()));
    }
    io::GridDescriptor descriptor(grid->getName(), grid->type(), grid->saveFloatAsHalf());
    descriptor.writeHeader(os);
    const auto positions = os.tellp();
    descriptor.writeStreamPos(os);
    descriptor.setGridPos(os.tellp());
    archive.setGridCompression(os, *grid);
    grid->writeMeta(os);
    grid->writeTransform(os);
    if (grid->isType<FloatGrid>())
      write_topology<FloatTree>(os, g);
    else
      write_topology<Vec3STree>(os, g);
    descriptor.setBlockPos(os.tellp());
    write_buffers(os, g);
    descriptor.setEndPos(os.tellp());
    os.seekp(positions);
    descriptor.writeStreamPos(os);
    os.seekp(descriptor.getEndPos());
  }
  bytes_ = static_cast<std::uint64_t>(os.tellp());
}

void StreamedVdb::finish() {
  spool_.flush(disk_);
  spool_.check(disk_.drain());
  std::fstream file(staged_.reopened(), std::ios::binary | std::ios::in | std::ios::out | std::ios::trunc);
  if (!file) fail("cannot be written");
  write(file);
  file.seekp(kTagAt);
  file << std::string(kTagSize, '0');
  file.seekg(0);
  ContentTag tag;
  std::string piece(1 << 20, '\0');
  for (std::uint64_t left = bytes_; left > 0 && file;) {
    const std::size_t n = std::min<std::uint64_t>(left, piece.size());
    file.read(piece.data(), static_cast<std::streamsize>(n));
    tag.add(std::string_view(piece).substr(0, n));
    left -= n;
  }
  file.seekp(kTagAt);
  file << tag.text();
  file.close();
  if (!file) fail("cannot be written to its end");
}

void StreamedVdb::commit(const std::string& final_name) {
  errno = staged_.publish(final_name);
  if (errno != 0) fail("cannot be completed");
}

}  // namespace lamina::volume
