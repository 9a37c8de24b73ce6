#include "vdb/streamed_vdb.h"

#include <fmt/format.h>
#include <openvdb/io/Archive.h>
#include <openvdb/io/Compression.h>
#include <openvdb/io/GridDescriptor.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <numeric>
#include <string_view>

#include "lamina/error.h"
#include "vdb/vdb_file.h"

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

/// A leaf's slot in its lower node, or a lower node's in its upper one: x slowest, z fastest.
constexpr Index slot_in(const std::array<std::int32_t, 3>& place, std::int32_t side) {
  return static_cast<Index>(((place[0] & (side - 1)) * side + (place[1] & (side - 1))) * side +
                            (place[2] & (side - 1)));
}

using LeafPlace = TileSigns::Place;
LeafPlace node_of(const LeafPlace& leaf, int shift) {
  return {leaf[0] >> shift, leaf[1] >> shift, leaf[2] >> shift};
}
constexpr int kLowerShift = 4, kUpperShift = 9;  ///< from a leaf's place to its nodes'

/// The first records, as many as lie in one node.
template <class Record>
std::span<const Record> first_node(std::span<const Record> records, int shift) {
  const LeafPlace node = node_of(records.front().place.leaf, shift);
  std::size_t count = 1;
  while (count < records.size() && node_of(records[count].place.leaf, shift) == node) ++count;
  return records.first(count);
}

}  // namespace

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
class StreamedVdb::Topology {
 public:
  Topology(const StreamedVdb& file, const Grid& grid)
      : file_(file),
        records_(grid.leaves),
        half_(grid.empty->saveFloatAsHalf()),
        background_(static_cast<const openvdb::Grid<Tree>&>(*grid.empty).background()),
        inside_(background_),
        signs_(voting(grid)) {
    if (is_level_set(grid)) inside_ = Value(-background_);
  }

  void write(std::ostream& os) const {
    Index uppers = 0;
    for (auto rest = records_; !rest.empty(); rest = rest.subspan(first_node(rest, kUpperShift).size())) ++uppers;
    put(os, std::int32_t{1});  // buffers
    put(os, half_ ? Value(io::truncateRealToHalf(background_)) : background_);
    io::setGridBackgroundValuePtr(os, &background_);
    put(os, Index{0});  // tiles of the root
    put(os, uppers);
    for (auto rest = records_; !rest.empty();) {
      const auto node = first_node(rest, kUpperShift);
      write_upper(os, node);
      rest = rest.subspan(node.size());
    }
    io::setGridBackgroundValuePtr(os, nullptr);
  }

 private:
  using Value = typename Tree::ValueType;
  using Upper = typename Tree::RootNodeType::ChildNodeType;
  using Lower = typename Upper::ChildNodeType;

  static bool is_level_set(const Grid& grid) { return grid.empty->getGridClass() == GRID_LEVEL_SET; }
  static std::vector<LeafVotes> voting(const Grid& grid) {
    std::vector<LeafVotes> places;
    if (!is_level_set(grid)) return places;
    places.reserve(grid.leaves.size());
    for (const Record& r : grid.leaves) places.push_back(r.place);
    return places;
  }

  void write_upper(std::ostream& os, std::span<const Record> leaves) const {
    const LeafPlace upper = node_of(leaves.front().place.leaf, kUpperShift);
    for (const std::int32_t k : upper) put(os, Int32{k * kUpper * kLower * 8});
    typename Upper::NodeMaskType children;
    for (const Record& r : leaves) children.setOn(slot_in(node_of(r.place.leaf, kLowerShift), kUpper));
    std::vector<Value> tiles(Upper::NUM_VALUES, zeroVal<Value>());
    for (Index slot = 0; slot < Upper::NUM_VALUES; ++slot) {
      if (children.isOn(slot)) continue;
      const auto n = static_cast<std::int32_t>(slot);
      const LeafPlace lower{upper[0] * kUpper + n / (kUpper * kUpper), upper[1] * kUpper + n / kUpper % kUpper,
                            upper[2] * kUpper + n % kUpper};
      tiles[slot] = signs_.inside(lower) ? inside_ : background_;
    }
    write_node<Upper>(os, children, tiles);
    for (auto rest = leaves; !rest.empty();) {
      const auto node = first_node(rest, kLowerShift);
      write_lower(os, node);
      rest = rest.subspan(node.size());
    }
  }

  void write_lower(std::ostream& os, std::span<const Record> leaves) const {
    typename Lower::NodeMaskType children;
    for (const Record& r : leaves) children.setOn(slot_in(r.place.leaf, kLower));
    const std::uint8_t* const inside = signs_.inside_tiles(node_of(leaves.front().place.leaf, kLowerShift));
    std::vector<Value> tiles(Lower::NUM_VALUES, zeroVal<Value>());
    for (Index slot = 0; slot < Lower::NUM_VALUES; ++slot)
      if (children.isOff(slot)) tiles[slot] = inside != nullptr && inside[slot] != 0 ? inside_ : background_;
    write_node<Lower>(os, children, tiles);
    constexpr std::size_t kMaskBytes = 64;  // a leaf's record begins with its mask
    file_.visit_records(leaves, [&](std::string_view leaf) { os << leaf.substr(0, kMaskBytes); });
  }

  template <class Node>
  void write_node(std::ostream& os, const typename Node::NodeMaskType& children, std::vector<Value>& tiles) const {
    const typename Node::NodeMaskType active_tiles;
    children.save(os);
    active_tiles.save(os);
    io::writeCompressedValues(os, tiles.data(), Node::NUM_VALUES, active_tiles, children, half_);
  }

  const StreamedVdb& file_;
  std::span<const Record> records_;
  bool half_;
  Value background_, inside_;  ///< of tiles
  TileSigns signs_;
};

void StreamedVdb::write_buffers(std::ostream& os, const Grid& grid) const {
  std::string piece;  // small writes cost the stream and the kernel more
  for (std::span<const Record> rest = grid.leaves; !rest.empty();) {
    const auto node = first_node(rest, kLowerShift);
    piece.clear();
    visit_records(node, [&](std::string_view leaf) { piece += leaf; });
    os << piece;
    rest = rest.subspan(node.size());
  }
}

void StreamedVdb::write_grid(std::ostream& os, const Grid& g) const {
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
  Archive archive;
  archive.setCompression(kCompression);
  archive.setGridCompression(os, *grid);
  grid->writeMeta(os);
  grid->writeTransform(os);
  if (grid->isType<FloatGrid>())
    Topology<FloatTree>(*this, g).write(os);
  else
    Topology<Vec3STree>(*this, g).write(os);
  descriptor.setBlockPos(os.tellp());
  write_buffers(os, g);
  descriptor.setEndPos(os.tellp());
  os.seekp(positions);
  descriptor.writeStreamPos(os);
  os.seekp(descriptor.getEndPos());
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
    write_grid(os, g);
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
