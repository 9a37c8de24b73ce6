#include "vdb/vdb_check.h"

#include <fmt/format.h>

#include <array>
#include <bit>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "vdb/vdb_points_check.h"
#include "vdb/vdb_walker.h"

namespace lamina::volume {
namespace {

void check_transform(Walker& w, int depth = 0) {
  constexpr std::uint64_t kVector = 3 * sizeof(double), kMatrix = 16 * sizeof(double);
  const std::string type = w.text();
  if (type == "ScaleMap" || type == "UniformScaleMap") {
    w.skip(5 * kVector);
  } else if (type == "ScaleTranslateMap" || type == "UniformScaleTranslateMap") {
    w.skip(6 * kVector);
  } else if (type == "TranslationMap") {
    w.skip(kVector);
  } else if (type == "AffineMap" || type == "UnitaryMap") {
    w.skip(kMatrix);
  } else if (type == "NonlinearFrustumMap" && depth == 0) {
    w.skip(2 * kVector + 2 * sizeof(double));
    check_transform(w, 1);
  } else {
    wrong("a transform is of no known type");
  }
}

/// What a tree's values are.
struct ValueKind {
  enum class Leaves { values, bits, masks, points };
  std::uint32_t bytes = 0, half = 0;  ///< `half`: of a value saved with 16 bits, 0 where that is not possible
  Leaves leaves = Leaves::values;
};

const ValueKind* kind_of(std::string_view tree) {
  using Leaves = ValueKind::Leaves;
  static const std::map<std::string_view, ValueKind> kinds{
      {"Tree_float_5_4_3", {4, 2}},
      {"Tree_double_5_4_3", {8, 2}},
      {"Tree_vec3s_5_4_3", {12, 6}},
      {"Tree_vec3d_5_4_3", {24, 6}},
      {"Tree_vec3i_5_4_3", {12, 0}},
      {"Tree_int32_5_4_3", {4, 0}},
      {"Tree_int64_5_4_3", {8, 0}},
      {"Tree_bool_5_4_3", {1, 0, Leaves::bits}},
      {"Tree_mask_5_4_3", {1, 0, Leaves::masks}},
      {"Tree_ptdataidx32_5_4_3", {4, 0, Leaves::points}},
  };
  const auto found = kinds.find(tree);
  return found == kinds.end() ? nullptr : &found->second;
}

enum Compression : std::uint32_t { kZip = 1, kActiveMask = 2, kBlosc = 4 };

class TreeWalk {
 public:
  TreeWalk(Walker& walker, const ValueKind& kind, std::uint32_t compression, bool as_half)
      : w_(walker), kind_(kind), compression_(compression), stored_(as_half && kind.half > 0 ? kind.half : kind.bytes) {
    half_ = as_half && kind.half > 0;
  }
  /// Returns the number of leaves, whose buffers it has passed if it knows them.
  std::uint64_t run() {
    const bool buffers = kind_.leaves != ValueKind::Leaves::points;
    w_.skip(sizeof(std::int32_t));  // buffers
    if (buffers)
      w_.skip(kind_.bytes);  // background
    else if (w_.number<std::uint32_t>() != 0)
      wrong("its points have a background");
    const auto tiles = w_.number<std::uint32_t>(), children = w_.number<std::uint32_t>();
    for (std::uint32_t i = 0; i < tiles; ++i) {
      w_.skip(3 * sizeof(std::int32_t) + kind_.bytes);
      if (w_.number<std::uint8_t>() > 1) wrong("a tile is neither active nor inactive");
    }
    std::uint64_t all = 0;
    std::vector<std::vector<std::uint64_t>> leaves;  // masks, eight words each, by upper node
    for (std::uint32_t i = 0; i < children; ++i) {
      w_.skip(3 * sizeof(std::int32_t));
      for (std::uint64_t lower = node<32>(); lower > 0; --lower) {
        const std::uint64_t count = node<16>();
        all += count;
        if (!buffers) {
          w_.skip(count * kMaskBytes);
          continue;
        }
        std::vector<std::uint64_t>& masks = leaves.emplace_back();
        if (count * kMaskBytes > w_.left()) throw std::ios::failure("the end");
        masks.resize(count * 8);
        w_.read(masks.data(), count * kMaskBytes);
      }
    }
    for (const auto& masks : leaves)
      for (std::size_t at = 0; at < masks.size(); at += 8) leaf(&masks[at]);
    return all;
  }

 private:
  static constexpr std::uint64_t kMaskBytes = 64;

  /// Masks and tile values; returns the number of children.
  template <std::uint64_t kSide>
  std::uint64_t node() {
    constexpr std::uint64_t kSlots = kSide * kSide * kSide;
    std::vector<std::uint64_t> children(kSlots / 64), active(kSlots / 64);
    w_.read(children.data(), kSlots / 8);
    w_.read(active.data(), kSlots / 8);
    values(kSlots, count(active.data(), active.size()));
    return count(children.data(), children.size());
  }
  static std::uint64_t count(const std::uint64_t* words, std::size_t n) {
    std::uint64_t sum = 0;
    for (std::size_t i = 0; i < n; ++i) sum += static_cast<std::uint64_t>(std::popcount(words[i]));
    return sum;
  }
  void leaf(const std::uint64_t* topology) {
    std::array<std::uint64_t, 8> mask{};
    w_.read(mask.data(), kMaskBytes);
    if (kind_.leaves != ValueKind::Leaves::values) {
      w_.skip(3 * sizeof(std::int32_t) + (kind_.leaves == ValueKind::Leaves::bits ? kMaskBytes : 0));
      return;
    }
    // The reader skips this copy of the mask in some files and takes it in others.
    const std::uint64_t active = count(mask.data(), 8);
    if (active != count(topology, 8)) wrong("a leaf's masks contradict each other");
    values(512, active);
  }
  void values(std::uint64_t slots, std::uint64_t active) {
    enum : std::int8_t { kOneInactive = 2, kMask = 3, kMaskOne = 4, kMaskTwo = 5, kAll = 6 };
    const auto what = w_.number<std::int8_t>();
    if (what < 0 || what > kAll) wrong("a node's values are of no known kind");
    if (what == kOneInactive || what == kMaskOne || what == kMaskTwo) w_.skip(kind_.bytes);
    if (what == kMaskTwo) w_.skip(kind_.bytes);
    if (what == kMask || what == kMaskOne || what == kMaskTwo) w_.skip(slots / 8);
    piece((compression_ & kActiveMask) != 0 && what != kAll ? active : slots);
  }
  void piece(std::uint64_t values) {
    if (half_ && values == 0) return;
    const std::uint64_t expected = values * stored_;
    if ((compression_ & (kBlosc | kZip)) == 0) {
      w_.skip(expected);
      return;
    }
    const auto size = w_.number<std::int64_t>();
    if (size <= 0) {
      if (0 - static_cast<std::uint64_t>(size) != expected) wrong("a node has more or fewer values than its masks say");
      w_.skip(expected);
      return;
    }
    const auto bytes = static_cast<std::uint64_t>(size);
    if (bytes > w_.left()) throw std::ios::failure("the end");
    if ((compression_ & kBlosc) == 0) {
      w_.skip(bytes);
      return;
    }
    if (bytes > expected + kBloscExtra) wrong("a compressed piece has a wrong size");
    if (check_blosc(w_, bytes) != expected) wrong("a compressed piece is damaged");
  }

  static constexpr std::uint64_t kBloscExtra = 4096;
  Walker& w_;
  ValueKind kind_;
  std::uint32_t compression_, stored_;
  bool half_ = false;
};

}  // namespace

void check_vdb(std::istream& file) {
  Walker w(file);
  w.skip(8);  // magic number
  const auto version = w.number<std::uint32_t>();
  w.skip(2 * sizeof(std::uint32_t));
  const bool offsets = w.number<char>() != 0;
  w.skip(36);  // tag
  check_metadata(w);
  const auto grids = w.number<std::int32_t>();
  for (std::int32_t i = 0; i < grids; ++i) {
    w.text();  // name
    std::string type = w.text();
    const bool instance = !w.text().empty();
    std::array<std::int64_t, 3> places{};  // of the grid, its values, its end
    w.read(places.data(), sizeof places);
    const auto compression = w.number<std::uint32_t>();
    const bool half = check_metadata(w);
    check_transform(w);
    if (instance) continue;
    constexpr std::string_view kHalf = "_HalfFloat";
    const bool half_type = type.ends_with(kHalf);
    if (half_type) type.resize(type.size() - kHalf.size());
    if (half_type != half) wrong("it contradicts itself about the precision of a grid");
    if (type == "Tree_string_5_4_3") wrong("it holds a grid of texts");
    const ValueKind* const kind = kind_of(type);
    if (kind != nullptr) {
      const std::uint64_t leaves = TreeWalk(w, *kind, compression, half).run();
      if (kind->leaves == ValueKind::Leaves::points) check_points(w, leaves, version);
      continue;
    }
    if (!offsets) break;
    w.go_to(places[2]);
  }
  file.seekg(0);
}

}  // namespace lamina::volume
