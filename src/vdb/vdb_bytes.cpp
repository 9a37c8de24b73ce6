#include "vdb/vdb_bytes.h"

#include <openvdb/io/Archive.h>

#include <algorithm>
#include <sstream>
#include <utility>

#include "vdb/content_tag.h"

namespace lamina::volume {
namespace {

/// io::File opens files by name and does not notice a full disk; the archive behind it writes to any stream.
struct WholeArchive : openvdb::io::Archive {
  using openvdb::io::Archive::write;
};

void tag_by_contents(std::string& bytes) {
  char* const at = bytes.data() + kTagAt;
  std::fill_n(at, kTagSize, '0');
  ContentTag tag;
  tag.add(bytes);
  const std::string text = tag.text();
  std::copy(text.begin(), text.end(), at);
}

}  // namespace

std::string vdb_bytes(const openvdb::GridCPtrVec& grids) {
  std::ostringstream stream(std::ios::binary);
  WholeArchive archive;
  archive.setCompression(openvdb::io::COMPRESS_BLOSC | openvdb::io::COMPRESS_ACTIVE_MASK);
  archive.write(stream, grids, /*seekable=*/true);
  std::string bytes = std::move(stream).str();
  tag_by_contents(bytes);
  return bytes;
}

}  // namespace lamina::volume
