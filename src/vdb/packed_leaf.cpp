#include "vdb/streamed_vdb.h"

#include <blosc.h>
#include <openvdb/io/Compression.h>

#include <algorithm>
#include <array>
#include <bit>
#include <limits>
#include <vector>

#include "lattice/morphology.h"

namespace lamina::volume {
namespace {

void put(std::string& to, const void* from, std::size_t bytes) {
  to.append(static_cast<const char*>(from), bytes);
}

/// As OpenVDB stores arrays: the size compressed and the bytes, or minus the size and the bytes as they are.
void put_compressed(std::string& to, const void* data, std::size_t bytes, std::size_t type_bytes) {
  constexpr int kLevel = 9, kShuffle = 1, kThreads = 1;
  std::array<char, 3 * 512 * sizeof(float) + BLOSC_MAX_OVERHEAD> packed;
  std::int64_t size = blosc_compress_ctx(kLevel, kShuffle, type_bytes, bytes, data, packed.data(), packed.size(),
                                         BLOSC_LZ4_COMPNAME, bytes, kThreads);
  const bool smaller = size > 0 && static_cast<std::size_t>(size) < bytes;
  const std::size_t stored = smaller ? static_cast<std::size_t>(size) : bytes;
  if (!smaller) size = -static_cast<std::int64_t>(bytes);
  put(to, &size, sizeof size);
  put(to, smaller ? packed.data() : data, stored);
}

openvdb::CoordBBox box_of(const openvdb::Coord& origin, const BlockMask& active) {
  std::uint32_t x = 0, y = 0, z = 0;
  for (std::uint32_t i = 0; i < 8; ++i) {
    const std::uint64_t w = active.words[i];
    if (w != 0) x |= 1U << i;
    for (std::uint32_t row = 0; row < 8; ++row) {
      const auto bits = static_cast<std::uint32_t>(w >> (8 * row) & 0xFF);
      if (bits != 0) y |= 1U << row;
      z |= bits;
    }
  }
  const auto low = [](std::uint32_t bits) { return std::countr_zero(bits); };
  const auto high = [](std::uint32_t bits) { return std::bit_width(bits) - 1; };
  if (x == 0) return {};
  return {origin.offsetBy(low(x), low(y), low(z)),
          origin.offsetBy(static_cast<int>(high(x)), static_cast<int>(high(y)), static_cast<int>(high(z)))};
}

}  // namespace

std::array<std::int8_t, 6> face_votes(const BlockMask& active, const BlockMask& negative) {
  // An active voxel's neighbour beyond the leaf must be on its side; the others only guess.
  std::array<std::int8_t, 6> out{};
  for (int f = 0; f < 6; ++f) {
    const BlockMask on_face = bits::face(2 - f / 2, f % 2 != 0);  // OpenVDB's last axis is the masks' first
    const BlockMask sure = active & on_face, guessed = on_face & ~active;
    const int votes =
        8 * (sure.count() - 2 * (sure & negative).count()) + guessed.count() - 2 * (guessed & negative).count();
    out[static_cast<std::size_t>(f)] = static_cast<std::int8_t>(std::clamp(votes / 4, -16, 16));
  }
  return out;
}

std::array<std::int8_t, 6> face_votes(const openvdb::FloatTree::LeafNodeType& leaf) {
  BlockMask active, negative;
  for (int at = 0; at < 512; ++at) {
    const auto voxel = static_cast<openvdb::Index>(at);
    active.assign(at, leaf.isValueOn(voxel));
    negative.assign(at, leaf.getValue(voxel) < 0);
  }
  return face_votes(active, negative);
}

void pack(const openvdb::Coord& origin, const LeafMasks& masks, std::span<const float> values, int width, bool half,
          PackedLeaf& out) {
  out.bytes.clear();
  out.faces = {};
  out.origin = origin;
  out.active = static_cast<std::uint32_t>(values.size() / static_cast<std::size_t>(width));
  out.box = box_of(origin, masks.active);
  const BlockMask inside = masks.inside & ~masks.active, outside = ~masks.inside & ~masks.active;
  put(out.bytes, masks.active.words.data(), sizeof masks.active.words);
  const char kind = !inside.any()   ? openvdb::io::NO_MASK_OR_INACTIVE_VALS
                    : outside.any() ? openvdb::io::MASK_AND_NO_INACTIVE_VALS
                                    : openvdb::io::NO_MASK_AND_MINUS_BG;
  out.bytes.push_back(kind);
  if (kind == openvdb::io::MASK_AND_NO_INACTIVE_VALS) put(out.bytes, outside.words.data(), sizeof outside.words);
  if (!half) {
    put_compressed(out.bytes, values.data(), values.size_bytes(), sizeof(float));
    return;
  }
  std::array<std::uint16_t, 3 * 512> halves;
  std::transform(values.begin(), values.end(), halves.begin(), [](float v) { return openvdb::math::half(v).bits(); });
  put_compressed(out.bytes, halves.data(), values.size() * sizeof halves[0], sizeof halves[0]);
}

namespace {

constexpr std::int32_t kSide = 16;
constexpr std::uint32_t kWhole = TileSigns::kSlots;

constexpr std::uint32_t slot_of(std::int32_t x, std::int32_t y, std::int32_t z) {
  return static_cast<std::uint32_t>((x * kSide + y) * kSide + z);
}

std::int8_t saturated(int v) {
  return static_cast<std::int8_t>(std::clamp(v, -127, 127));
}

}  // namespace

std::uint32_t TileSigns::cell_of(const Place& node) const {
  for (std::size_t k = 0; k < 3; ++k)
    if (node[k] < low_[k] || node[k] >= low_[k] + size_[k]) return std::numeric_limits<std::uint32_t>::max();
  return static_cast<std::uint32_t>(((node[0] - low_[0]) * size_[1] + node[1] - low_[1]) * size_[2] + node[2] -
                                    low_[2]);
}

std::uint8_t& TileSigns::state(const Slot& s) {
  return s.slot == kWhole ? empty_[s.cell] : nodes_[static_cast<std::size_t>(node_at_[s.cell])].state[s.slot];
}

std::int32_t TileSigns::vote_of(const Slot& s) const {
  if (s.slot != kWhole) return nodes_[static_cast<std::size_t>(node_at_[s.cell])].votes[s.slot];
  const auto found = empty_votes_.find(s.cell);
  return found == empty_votes_.end() ? 0 : found->second;
}

TileSigns::TileSigns(const std::vector<LeafVotes>& leaves) {
  if (leaves.empty()) return;
  Place high{};
  low_.fill(std::numeric_limits<std::int32_t>::max());
  high.fill(std::numeric_limits<std::int32_t>::min());
  for (const LeafVotes& l : leaves) {
    for (std::size_t k = 0; k < 3; ++k) {
      low_[k] = std::min(low_[k], (l.leaf[k] >> 4) - 1);
      high[k] = std::max(high[k], (l.leaf[k] >> 4) + 1);
    }
  }
  // Leaves scattered so widely enclose nothing that could be told cheaply: everything is outside.
  constexpr double kMostCells = 1 << 26;
  double cells = 1;
  for (std::size_t k = 0; k < 3; ++k) {
    size_[k] = high[k] - low_[k] + 1;
    cells *= static_cast<double>(high[k]) - low_[k] + 1;
  }
  if (cells > kMostCells) {
    size_ = {};
    return;
  }
  node_at_.assign(static_cast<std::size_t>(cells), -1);
  empty_.assign(node_at_.size(), kUnknown);
  for (const LeafVotes& l : leaves) {
    const std::uint32_t cell = cell_of({l.leaf[0] >> 4, l.leaf[1] >> 4, l.leaf[2] >> 4});
    std::int32_t& at = node_at_[cell];
    if (at < 0) {
      at = static_cast<std::int32_t>(nodes_.size());
      nodes_.push_back({std::vector<std::uint8_t>(kSlots, kUnknown), std::vector<std::int8_t>(kSlots, 0)});
    }
    nodes_[static_cast<std::size_t>(at)].state[slot_of(l.leaf[0] & 15, l.leaf[1] & 15, l.leaf[2] & 15)] = kLeaf;
  }
  for (const LeafVotes& l : leaves) vote(l);

  flood({0, kWhole}, true);
  for (std::uint32_t cell = 0; cell < node_at_.size(); ++cell) {
    if (node_at_[cell] < 0) {
      if (empty_[cell] == kUnknown) flood({cell, kWhole}, false);
      continue;
    }
    for (std::uint32_t slot = 0; slot < kWhole; ++slot)
      if (state({cell, slot}) == kUnknown) flood({cell, slot}, false);
  }
  spread_local();
  for (Node& n : nodes_) {
    for (std::uint8_t& state : n.state) state = state == kInside;
    n.votes = std::vector<std::int8_t>();  // = {} would keep the memory
  }
}

void TileSigns::vote(const LeafVotes& leaf) {
  for (std::size_t face = 0; face < 6; ++face) {
    if (leaf.faces[face] == 0) continue;
    Place beside = leaf.leaf;
    beside[face / 2] += face % 2 == 0 ? -1 : 1;
    const std::uint32_t cell = cell_of({beside[0] >> 4, beside[1] >> 4, beside[2] >> 4});
    if (node_at_[cell] < 0) {
      empty_votes_[cell] += leaf.faces[face];
      continue;
    }
    std::int8_t& votes =
        nodes_[static_cast<std::size_t>(node_at_[cell])].votes[slot_of(beside[0] & 15, beside[1] & 15, beside[2] & 15)];
    votes = saturated(votes + leaf.faces[face]);
  }
}

/// The places that share a face with one. An empty node beside a filled one touches all slots of that side.
template <class Visit>
void TileSigns::for_each_neighbour(const Slot& s, const Visit& visit) const {
  const auto cell = static_cast<std::int32_t>(s.cell);
  const Place at{cell / (size_[1] * size_[2]), cell / size_[2] % size_[1], cell % size_[2]};
  const Place stride{size_[1] * size_[2], size_[2], 1};
  const auto slot = static_cast<std::int32_t>(s.slot);
  const Place in{slot / (kSide * kSide), slot / kSide % kSide, slot % kSide};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (const std::int32_t step : {-1, 1}) {
      if (s.slot != kWhole && in[axis] + step >= 0 && in[axis] + step < kSide) {
        Place next = in;
        next[axis] += step;
        visit(Slot{s.cell, slot_of(next[0], next[1], next[2])});
        continue;
      }
      if (at[axis] + step < 0 || at[axis] + step >= size_[axis]) continue;
      const auto other = static_cast<std::uint32_t>(cell + step * stride[axis]);
      if (node_at_[other] < 0) {
        visit(Slot{other, kWhole});
        continue;
      }
      const std::int32_t side = step < 0 ? kSide - 1 : 0;
      if (s.slot != kWhole) {
        Place next = in;
        next[axis] = side;
        visit(Slot{other, slot_of(next[0], next[1], next[2])});
        continue;
      }
      for (std::int32_t u = 0; u < kSide; ++u) {
        for (std::int32_t v = 0; v < kSide; ++v) {
          Place next{};
          next[axis] = side;
          next[(axis + 1) % 3] = u;
          next[(axis + 2) % 3] = v;
          visit(Slot{other, slot_of(next[0], next[1], next[2])});
        }
      }
    }
  }
}

void TileSigns::flood(const Slot& seed, bool outside) {
  std::vector<Slot> region{seed};
  state(seed) = kOutside;
  std::int64_t votes = vote_of(seed);
  // A region known to be outside need not be remembered.
  std::vector<Slot> rest;
  while (!region.empty()) {
    const Slot s = region.back();
    region.pop_back();
    if (!outside) rest.push_back(s);
    for_each_neighbour(s, [&](const Slot& next) {
      std::uint8_t& st = state(next);
      if (st != kUnknown) return;
      st = kOutside;
      votes += vote_of(next);
      region.push_back(next);
    });
  }
  if (outside || votes >= 0) return;
  for (const Slot& s : rest) state(s) = kInside;
}

void TileSigns::spread_local() {
  // A tile's own neighbours know better than its region; and the next tile, which meets active voxels at a corner.
  std::vector<Slot> turned;
  for (std::uint32_t cell = 0; cell < node_at_.size(); ++cell) {
    if (node_at_[cell] < 0) continue;
    for (std::uint32_t slot = 0; slot < kWhole; ++slot) {
      const Slot s{cell, slot};
      const std::int32_t v = vote_of(s);
      if (state(s) == kLeaf || v == 0) continue;
      const std::uint8_t own = v < 0 ? kInside : kOutside;
      if (state(s) == own) continue;
      state(s) = own;
      turned.push_back(s);
    }
  }
  for (const auto& [cell, v] : empty_votes_)
    if (empty_[cell] == kOutside && v < 0) empty_[cell] = kInside;
  for (const Slot& s : turned) {
    const std::uint8_t own = state(s);
    for_each_neighbour(s, [&](const Slot& next) {
      if (next.slot == kWhole || state(next) == kLeaf || vote_of(next) != 0) return;
      state(next) = own;
    });
  }
}

const std::uint8_t* TileSigns::inside_tiles(const Place& node) const {
  const std::uint32_t cell = cell_of(node);
  if (cell >= node_at_.size() || node_at_[cell] < 0) return nullptr;
  return nodes_[static_cast<std::size_t>(node_at_[cell])].state.data();
}

bool TileSigns::inside(const Place& node) const {
  const std::uint32_t cell = cell_of(node);
  return cell < empty_.size() && empty_[cell] == kInside;
}

void sign_tiles(openvdb::FloatGrid& grid) {
  std::vector<LeafVotes> votes;
  for (auto leaf = grid.tree().cbeginLeaf(); leaf; ++leaf) {
    const openvdb::Coord o = leaf->origin();
    votes.push_back({{o[0] >> 3, o[1] >> 3, o[2] >> 3}, face_votes(*leaf)});
  }
  const TileSigns signs(votes);
  auto tile = grid.tree().beginValueOff();
  tile.setMaxDepth(openvdb::FloatTree::ValueOffIter::LEAF_DEPTH - 1);
  for (; tile; ++tile) {
    const openvdb::Coord o = tile.getCoord();
    const TileSigns::Place node{o[0] >> 7, o[1] >> 7, o[2] >> 7};
    bool inside = signs.inside(node);
    if (tile.getLevel() == 1) {
      const std::uint8_t* const tiles = signs.inside_tiles(node);
      const int slot = ((o[0] >> 3 & 15) * 16 + (o[1] >> 3 & 15)) * 16 + (o[2] >> 3 & 15);
      inside = tiles != nullptr && tiles[slot] != 0;
    }
    tile.setValue(inside ? -grid.background() : grid.background());
  }
}

}  // namespace lamina::volume
