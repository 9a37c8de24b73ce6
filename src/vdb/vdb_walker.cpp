#include "vdb/vdb_walker.h"

#include <blosc.h>
#include <fmt/format.h>

#include <map>
#include <stdexcept>
#include <string_view>
#include <vector>

namespace lamina::volume {

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

}  // namespace

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

namespace {

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

}  // namespace

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

}  // namespace lamina::volume
