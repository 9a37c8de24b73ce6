#include "volume/vdb_bytes.h"

#include <fmt/format.h>
#include <openvdb/io/Archive.h>

#include <algorithm>
#include <cstdint>
#include <sstream>
#include <string_view>
#include <utility>

namespace lamina::volume {
namespace {

/// io::File opens files by name and does not notice a full disk; the archive behind it writes to any stream.
struct Archive : openvdb::io::Archive {
  using openvdb::io::Archive::write;
};

/// FNV-1a, 64 bits.
std::uint64_t hash(std::string_view bytes, std::uint64_t h) {
  for (const char c : bytes) h = (h ^ static_cast<std::uint8_t>(c)) * 0x100000001b3ULL;
  return h;
}

/// The file's tag, a UUID in text, stands behind magic number, three version numbers and a flag.
constexpr std::size_t kTagAt = 8 + 3 * 4 + 1;
constexpr std::size_t kTagSize = 36;

void tag_by_contents(std::string& bytes) {
  char* const tag = bytes.data() + kTagAt;
  std::fill_n(tag, kTagSize, '0');
  const std::uint64_t a = hash(bytes, 0xcbf29ce484222325ULL), b = hash(bytes, a);
  // Version 8 of RFC 9562: the maker's own scheme.
  const std::string text = fmt::format("{:08x}-{:04x}-8{:03x}-a{:03x}-{:012x}", a >> 32, (a >> 16) & 0xFFFF, a & 0xFFF,
                                       b >> 52, b & 0xFFFFFFFFFFFFULL);
  std::copy(text.begin(), text.end(), tag);
}

}  // namespace

std::string vdb_bytes(const openvdb::GridCPtrVec& grids) {
  std::ostringstream stream(std::ios::binary);
  Archive archive;
  archive.setCompression(openvdb::io::COMPRESS_BLOSC | openvdb::io::COMPRESS_ACTIVE_MASK);
  archive.write(stream, grids, /*seekable=*/true);
  std::string bytes = std::move(stream).str();
  tag_by_contents(bytes);
  return bytes;
}

}  // namespace lamina::volume
