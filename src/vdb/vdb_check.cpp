#include "vdb/vdb_file.h"

#include <blosc.h>
#include <fmt/format.h>

#include <array>
#include <bit>
#include <cstdint>
#include <map>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace lamina::volume {
namespace {

/// The piece, and in `unpacked` the size of what is in it.
std::vector<char> read_blosc(Walker& w, std::uint64_t bytes, std::size_t& unpacked) {
  if (bytes > w.left()) throw std::ios::failure("the end");
  if (bytes < BLOSC_MIN_HEADER_LENGTH) wrong("a compressed piece is too short");
  std::vector<char> chunk(bytes);
  w.read(chunk.data(), bytes);
  if (blosc_cbuffer_validate(chunk.data(), bytes, &unpacked) != 0) wrong("a compressed piece is damaged");
  return chunk;
}

/// One of the table's two arrays, compressed where its size is not 0.
void check_leaf_array(Walker& w, std::uint32_t packed, std::uint64_t bytes) {
  if (packed == 0) return w.skip(bytes);
  if (!holds(check_blosc(w, packed), bytes)) wrong("a table of leaves is damaged");
}

/// What each leaf is like, for readers that load it later: one byte of each, and where told eight more. OpenVDB goes by
/// what is inside, not by the length before it, and asks for memory by the number of leaves, each of which takes a byte
/// of the file at least.
void check_leaf_table(Walker& w, std::uint64_t bytes) {
  if (bytes == 0) return;
  constexpr std::uint32_t kNone = 0xffffffff;
  const std::uint64_t before = w.left();
  const auto leaves = w.number<std::uint32_t>();
  if (leaves > w.left()) wrong("a table of leaves does not fit into it");
  check_leaf_array(w, w.number<std::uint32_t>(), leaves);
  const auto packed = w.number<std::uint32_t>();
  if (packed != kNone) check_leaf_array(w, packed, 8 * std::uint64_t{leaves});
  const std::uint64_t walked = before - w.left();
  if (walked > bytes) wrong("a table of leaves is longer than it says");
  w.skip(bytes - walked);
}

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

const ValueKind* value_kind(std::string_view tree) {
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

void wrong(const std::string& what) {
  throw std::runtime_error(what);
}

std::string Walker::text() {
  const auto length = number<std::uint32_t>();
  constexpr std::uint32_t kLongest = 1 << 24;
  if (length > kLongest || length > left_) wrong(fmt::format("a text of {} bytes does not fit into it", length));
  std::string out(length, '\0');
  read(out.data(), length);
  return out;
}

void Walker::go_to(std::int64_t place) {
  const std::uint64_t here = size_ - left_;
  if (place < 0 || static_cast<std::uint64_t>(place) < here || static_cast<std::uint64_t>(place) > size_)
    wrong("a grid ends outside of it");
  left_ = size_ - static_cast<std::uint64_t>(place);
  file_.seekg(place);
}

std::uint64_t check_blosc(Walker& w, std::uint64_t bytes) {
  std::size_t unpacked = 0;
  read_blosc(w, bytes, unpacked);
  return unpacked;
}

bool holds(std::uint64_t unpacked, std::uint64_t bytes) {
  constexpr std::uint64_t kPadded = 128;
  return unpacked == bytes || (bytes <= kPadded && unpacked == kPadded);
}

std::uint64_t unpack_blosc(Walker& w, std::uint64_t bytes) {
  constexpr std::uint64_t kMostPerByte = 2048;  // no compressor of Blosc's is that good
  std::size_t unpacked = 0;
  const std::vector<char> chunk = read_blosc(w, bytes, unpacked);
  if (unpacked > kMostPerByte * bytes) wrong("a compressed piece claims to hold too much");
  std::vector<char> values(unpacked);
  const int got = blosc_decompress_ctx(chunk.data(), values.data(), values.size(), 1);
  if (got < 0 || static_cast<std::size_t>(got) != unpacked) wrong("a compressed piece is damaged");
  return unpacked;
}

bool check_metadata(Walker& w) {
  static const std::map<std::string, std::uint32_t, std::less<>> sizes{
      {"bool", 1},   {"double", 8}, {"float", 4},  {"int32", 4},  {"int64", 8},  {"vec2d", 16},
      {"vec2i", 8},  {"vec2s", 8},  {"vec3d", 24}, {"vec3i", 12}, {"vec3s", 12}, {"vec4d", 32},
      {"vec4i", 16}, {"vec4s", 16}, {"mat4s", 64}, {"mat4d", 128}};
  bool half = false;
  const auto count = w.number<std::uint32_t>();
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::string name = w.text(), type = w.text();
    const auto bytes = w.number<std::uint32_t>();
    const auto known = sizes.find(type);
    if (known != sizes.end() && known->second != bytes)
      wrong(fmt::format("metadata {} of type {} has {} bytes", name, type, bytes));
    if (bytes > w.left()) wrong(fmt::format("metadata {} of {} bytes does not fit into it", name, bytes));
    constexpr std::string_view kHalf = "is_saved_as_half_float";
    // Of any other type it would hold whenever there is something in it.
    if (name == kHalf && type != "bool") wrong(fmt::format("metadata {} is of type {}", name, type));
    if (name == kHalf)
      half = w.number<std::uint8_t>() != 0;
    else if (type == "__delayedload")
      check_leaf_table(w, bytes);
    else
      w.skip(bytes);
  }
  return half;
}

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
    const ValueKind* const kind = value_kind(type);
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
