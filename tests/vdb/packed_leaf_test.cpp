// Leaves packed from masks, against OpenVDB's own reader and its leaves.
#include "vdb/streamed_vdb.h"

#include <gtest/gtest.h>
#include <openvdb/io/Compression.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <sstream>
#include <vector>

namespace lamina::volume {
namespace {

using openvdb::FloatTree;
using openvdb::Vec3STree;

constexpr float kBackground = 3;

/// Reads the record as a file's reader does.
template <class Leaf, class Value>
void read_back(const PackedLeaf& packed, const Value& background, bool half, Leaf& leaf) {
  std::istringstream in(packed.bytes, std::ios::binary);
  openvdb::io::setCurrentVersion(in);
  openvdb::io::setDataCompression(in, openvdb::io::COMPRESS_BLOSC | openvdb::io::COMPRESS_ACTIVE_MASK);
  openvdb::io::setGridBackgroundValuePtr(in, &background);
  leaf.readBuffers(in, half);
  RC_ASSERT(in.good());
  RC_ASSERT(static_cast<std::size_t>(in.tellg()) == packed.bytes.size());
}

/// Voxels on a leaf's faces by their own values: active ones count eight times.
std::array<std::int8_t, 6> votes_by_value(const FloatTree::LeafNodeType& leaf) {
  std::array<int, 6> votes{};
  for (openvdb::Index at = 0; at < FloatTree::LeafNodeType::SIZE; ++at) {
    const openvdb::Coord in = FloatTree::LeafNodeType::offsetToLocalCoord(at);
    for (int face = 0; face < 6; ++face) {
      if (in[face / 2] != (face % 2 == 0 ? 0 : 7)) continue;
      votes[static_cast<std::size_t>(face)] += (leaf.isValueOn(at) ? 8 : 1) * (leaf.getValue(at) < 0 ? -1 : 1);
    }
  }
  std::array<std::int8_t, 6> out{};
  for (std::size_t f = 0; f < 6; ++f) out[f] = static_cast<std::int8_t>(std::clamp(votes[f] / 4, -16, 16));
  return out;
}

/// Of each voxel: whether it is active, and its side.
using States = std::vector<int>;
rc::Gen<States> states() {
  const auto any = rc::gen::container<States>(512, rc::gen::inRange(0, 4));
  const auto inside = rc::gen::container<States>(512, rc::gen::element(1, 3));
  const auto outside = rc::gen::container<States>(512, rc::gen::element(0, 1));
  return rc::gen::oneOf(any, inside, outside);
}

RC_GTEST_PROP(PackLeaves, IsWhatOpenVdbReadsAndVotesFor, ()) {
  openvdb::initialize();
  const States state = *states();
  const bool half = *rc::gen::arbitrary<bool>();
  const openvdb::Coord origin(-16, 8, 24);
  FloatTree::LeafNodeType leaf(origin, kBackground);
  LeafMasks masks;
  std::vector<float> values;
  for (int at = 0; at < 512; ++at) {
    const bool active = (state[at] & 1) != 0, inside = (state[at] & 2) != 0;
    // Exact in 16 bits.
    const float value = (inside ? -1.0F : 1.0F) * (active ? static_cast<float>(at % 64 + 1) / 32 : kBackground);
    if (inside) masks.inside.set(at);
    if (active) {
      masks.active.set(at);
      values.push_back(value);
      leaf.setValueOn(at, value);
    } else {
      leaf.setValueOff(at, value);
    }
  }
  if (values.empty()) return;
  PackedLeaf packed;
  pack(origin, masks, values, 1, half, packed);
  FloatTree::LeafNodeType back(origin, 0);
  read_back(packed, kBackground, half, back);
  for (openvdb::Index at = 0; at < 512; ++at) {
    RC_ASSERT(back.isValueOn(at) == leaf.isValueOn(at));
    RC_ASSERT(back.getValue(at) == leaf.getValue(at));
  }
  openvdb::CoordBBox box;
  leaf.evalActiveBoundingBox(box);
  RC_ASSERT(packed.box == box);
  RC_ASSERT(packed.active == leaf.onVoxelCount());
  RC_ASSERT(face_votes(masks.active, masks.inside) == votes_by_value(leaf));
  RC_ASSERT(face_votes(leaf) == votes_by_value(leaf));
}

RC_GTEST_PROP(PackLeaves, HoldsVectors, (bool half)) {
  openvdb::initialize();
  LeafMasks masks;
  std::vector<float> values;
  for (int at = 0; at < 512; at += *rc::gen::inRange(1, 60)) {
    masks.active.set(at);
    for (int k = 0; k < 3; ++k) values.push_back(static_cast<float>(at - 200 * k));
  }
  PackedLeaf packed;
  pack({}, masks, values, 3, half, packed);
  Vec3STree::LeafNodeType back;
  read_back(packed, openvdb::Vec3s(0), half, back);
  std::size_t next = 0;
  for (openvdb::Index at = 0; at < 512; ++at) {
    RC_ASSERT(back.isValueOn(at) == masks.active.test(static_cast<int>(at)));
    const openvdb::Vec3s v = back.getValue(at);
    for (int k = 0; k < 3; ++k) RC_ASSERT(v[k] == (back.isValueOn(at) ? values[next++] : 0.0F));
  }
}

TEST(PackLeaves, RoundsToSixteenBitsAsOpenVdbDoes) {
  openvdb::initialize();
  LeafMasks masks;
  for (int at = 0; at < 512; ++at) masks.active.set(at);
  // Every place between two numbers of sixteen bits, halfway included, the smallest numbers and the largest.
  for (std::uint32_t begin = 0; begin < 0x7BFFU * 4; begin += 512 * 13) {
    std::vector<float> values(512);
    for (std::uint32_t i = 0; i < 512; ++i) {
      const std::uint32_t quarter = std::min(begin + i, 0x7BFFU * 4 - 1);
      openvdb::math::half low, high;
      low.setBits(static_cast<std::uint16_t>(quarter / 4));
      high.setBits(static_cast<std::uint16_t>(quarter / 4 + 1));
      values[i] = (i % 2 == 0 ? 1.0F : -1.0F) * (low + (high - low) * static_cast<float>(quarter % 4) / 4);
    }
    PackedLeaf packed;
    pack({}, masks, values, 1, true, packed);
    FloatTree::LeafNodeType back;
    read_back(packed, kBackground, true, back);
    for (openvdb::Index at = 0; at < 512; ++at)
      ASSERT_EQ(back.getValue(at), static_cast<float>(openvdb::math::half(values[at]))) << values[at];
  }
}

}  // namespace
}  // namespace lamina::volume
