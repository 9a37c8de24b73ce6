#include "points/laz_record_sink.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>

#include "base/descriptor.h"
#include "base/little_endian.h"
#include "laz/chunks.h"
#include "points/las_header.h"
#include "points/laz_packing.h"

namespace lamina {

LazRecordSink::LazRecordSink(const LasLayout& layout)
    : layout_{.bytes = layout.record_bytes(),
              .extra_bytes = layout.record_bytes() - las_record_bytes(layout.point_format()),
              .colours = layout.has_colours()} {}

std::string LazRecordSink::packing(const LasLayout& layout) {
  return laz_packing_record(layout.point_format(), layout.record_bytes(), kChunkPoints);
}

std::string LazRecordSink::lead() const {
  std::string bytes;
  append_little(bytes, table_);
  return bytes;
}

int LazRecordSink::put(int fd, const std::vector<std::byte>& bytes) {
  written_ += bytes.size();
  return write_all(fd, bytes.data(), bytes.size());
}

int LazRecordSink::compress(int fd) {
  const std::size_t chunks = (records_ + kChunkPoints - 1) / kChunkPoints;
  std::array<std::vector<std::byte>, kChunksAtOnce> code;
  tbb::parallel_for(std::size_t{0}, chunks, [&](std::size_t i) {
    const std::size_t first = i * kChunkPoints;
    code.at(i) =
        laz::encode_layered(layout_, waiting_.data() + first * layout_.bytes, std::min(kChunkPoints, records_ - first));
  });
  records_ = 0;
  for (std::size_t i = 0; i < chunks; ++i) {
    chunk_bytes_.push_back(static_cast<std::uint32_t>(code.at(i).size()));
    if (const int error = put(fd, code.at(i)); error != 0) return error;
  }
  return 0;
}

int LazRecordSink::finish(int fd) {
  if (const int error = compress(fd); error != 0) return error;
  table_ = begin_ + written_;
  std::string head;
  append_little(head, std::uint32_t{0});  // version of the table
  append_little(head, static_cast<std::uint32_t>(chunk_bytes_.size()));
  std::vector<std::byte> table(head.size());
  std::transform(head.begin(), head.end(), table.begin(), [](char c) { return static_cast<std::byte>(c); });
  if (!chunk_bytes_.empty()) {
    const std::vector<std::byte> code = laz::encode_chunk_table(chunk_bytes_);
    table.insert(table.end(), code.begin(), code.end());
  }
  return put(fd, table);
}

}  // namespace lamina
