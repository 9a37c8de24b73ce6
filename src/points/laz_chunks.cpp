#include "points/laz_chunks.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "base/little_endian.h"
#include "lamina/error.h"
#include "laz/arithmetic_coder.h"
#include "laz/chunks.h"

namespace lamina {
namespace {

class ChunkFinder {
 public:
  ChunkFinder(const InputFile& file, const LasHeader& header)
      : file_(file), header_(header), packing_(*header.packing), begin_(header.data) {}

  LazChunks find() {
    if (packing_.chunked) {
      begin_ += kPointerBytes;
      if (std::optional<LazChunks> tabled = by_table()) return std::move(*tabled);
    }
    LazChunks walked;
    walked.without_table = packing_.chunked;
    if (header_.count == 0) require_nothing_follows();
    try {
      for (std::uint64_t at = begin_, done = 0; done < header_.count;) {
        const LazChunk chunk = packing_.layered ? layered_chunk(at, done) : pointwise_chunk(at, done);
        walked.chunks.push_back(chunk);
        at += chunk.bytes;
        done += chunk.points;
        walked.uncounted = done - std::min(done, header_.count);
      }
    } catch (const laz::Damaged& damage) {
      const LazChunk last = walked.chunks.empty() ? LazChunk{begin_} : walked.chunks.back();
      refuse(
          fmt::format("the chunk table is missing, and of the {} points that the header promises {} are found; the "
                      "chunk at byte {}: {}; the file was cut short or damaged",
                      header_.count, last.first + last.points, last.offset + last.bytes, damage.what()));
    }
    return walked;
  }

 private:
  static constexpr std::size_t kPointerBytes = 8;  ///< the offset of the chunk table stands before the chunks

  [[noreturn]] void refuse(const std::string& what) const {
    throw Error(ExitCode::unreadable, fmt::format("{}: {}", file_.name, what));
  }

  void require_nothing_follows() const {
    if (file_.bytes < begin_ + header_.record_bytes) return;
    refuse(
        "the header counts no points, but compressed ones follow: its writer was stopped before it knew their number");
  }

  template <class T>
  std::optional<T> value_at(std::uint64_t offset) const {
    std::array<std::byte, sizeof(T)> bytes{};
    if (offset > file_.bytes || file_.read(offset, bytes.data(), bytes.size()) < bytes.size()) return std::nullopt;
    return load_little<T>(bytes.data());
  }

  /// The offset of the chunk table. A writer that cannot go back leaves -1 before the chunks, and the offset at the
  /// end.
  std::optional<std::uint64_t> table_offset() const {
    std::optional<std::uint64_t> offset = value_at<std::uint64_t>(header_.data);
    if (offset == ~std::uint64_t{0} && file_.bytes >= kPointerBytes) {
      offset = value_at<std::uint64_t>(file_.bytes - kPointerBytes);
    }
    if (!offset || *offset < begin_ || *offset >= file_.bytes) return std::nullopt;
    return offset;
  }

  /// Nothing where the table is missing or makes no sense.
  std::optional<LazChunks> by_table() const {
    const std::optional<std::uint64_t> offset = table_offset();
    if (!offset) return std::nullopt;
    const auto version = value_at<std::uint32_t>(*offset);
    const auto count = value_at<std::uint32_t>(*offset + 4);
    if (version != 0U || !count) return std::nullopt;
    const bool with_points = packing_.chunk_points == LazPacking::kVariable;
    std::vector<laz::TabledChunk> table;
    try {
      table = laz::decode_chunk_table(table_code(*offset + 8, *count), *count, with_points, *offset - begin_);
    } catch (const laz::Damaged&) {
      return std::nullopt;
    }
    return placed(table);
  }

  [[nodiscard]] std::vector<std::byte> table_code(std::uint64_t offset, std::uint64_t entries) const {
    constexpr std::uint64_t kMostEntryBytes = 24;
    const std::uint64_t most = std::min(file_.bytes - std::min(offset, file_.bytes), kMostEntryBytes * (entries + 1));
    std::vector<std::byte> code(static_cast<std::size_t>(most));
    code.resize(file_.read(offset, code.data(), code.size()));
    return code;
  }

  /// Throws where the header promises more points than the table has.
  [[nodiscard]] LazChunks placed(const std::vector<laz::TabledChunk>& table) const {
    LazChunks found;
    LazChunk chunk{begin_};
    for (const laz::TabledChunk& entry : table) {
      chunk.bytes = entry.bytes;
      chunk.points = entry.points;
      if (packing_.chunk_points != LazPacking::kVariable) {
        // Those behind all that are counted are full ones, as far as anyone can tell.
        const std::uint64_t left = header_.count - std::min(header_.count, chunk.first);
        chunk.points = left == 0 ? packing_.chunk_points : std::min<std::uint64_t>(packing_.chunk_points, left);
      }
      require_sensible(chunk, file_, header_);
      if (chunk.points > 0) found.chunks.push_back(chunk);
      chunk.offset += chunk.bytes;
      chunk.first += chunk.points;
    }
    if (chunk.first < header_.count) {
      refuse(
          fmt::format("the header promises {} points, the chunk table has {}: it was cut short or the header's count "
                      "is wrong",
                      header_.count, chunk.first));
    }
    found.uncounted = chunk.first - header_.count;
    if (header_.count == 0 && found.uncounted > 0) require_nothing_follows();
    return found;
  }

  [[nodiscard]] LazChunk layered_chunk(std::uint64_t at, std::uint64_t done) const {
    std::vector<std::byte> head(laz::layered_head_bytes(packing_.layout));
    if (file_.read(at, head.data(), head.size()) < head.size()) throw laz::Damaged("it is cut short");
    const laz::LayeredSize size = laz::layered_size(packing_.layout, head);
    if (size.points == 0 || size.bytes > file_.bytes - at) throw laz::Damaged("it is cut short");
    const LazChunk chunk{at, size.bytes, done, size.points};
    require_sensible(chunk, file_, header_);
    return chunk;
  }

  /// Only decoding tells where it ends. As few bytes are read as will do: compressed points seldom take more than
  /// others.
  [[nodiscard]] LazChunk pointwise_chunk(std::uint64_t at, std::uint64_t done) const {
    const std::uint64_t most = packing_.chunked ? packing_.chunk_points : LazPacking::kVariable;
    LazChunk chunk{at, file_.bytes - std::min(at, file_.bytes), done, std::min(header_.count - done, most)};
    require_sensible(chunk, file_, header_);
    const auto points = static_cast<std::size_t>(chunk.points);
    const auto records = std::make_unique_for_overwrite<std::byte[]>(points * header_.record_bytes);
    constexpr std::uint64_t kLeastWindow = 4096;
    std::uint64_t window = kLeastWindow + chunk.points * header_.record_bytes;
    for (;; window *= 2) {
      std::vector<std::byte> code(static_cast<std::size_t>(std::min(window, chunk.bytes)));
      code.resize(file_.read(at, code.data(), code.size()));
      try {
        chunk.bytes = laz::decode_unbounded(packing_.layout, code, points, records.get());
        return chunk;
      } catch (const laz::Damaged&) {
        if (window >= chunk.bytes) throw;
      }
    }
  }

  const InputFile& file_;
  const LasHeader& header_;
  const LazPacking& packing_;
  std::uint64_t begin_;
};

}  // namespace

void require_sensible(const LazChunk& chunk, const InputFile& file, const LasHeader& header) {
  const auto refuse = [&](const std::string& what) {
    throw Error(ExitCode::unreadable, fmt::format("{}: {}", file.name, what));
  };
  constexpr std::uint64_t kMostPerByte = 1000;
  if (chunk.points / kMostPerByte > chunk.bytes) {
    refuse(fmt::format("the chunk at byte {} cannot hold {} points in its {} bytes: it is damaged", chunk.offset,
                       chunk.points, chunk.bytes));
  }
  if (chunk.points > kMostChunkBytes / header.record_bytes) {
    refuse(
        fmt::format("the {} points at byte {} are compressed as one piece; compress them anew in chunks: laszip -i "
                    "FILE -o OTHER.laz",
                    chunk.points, chunk.offset));
  }
}

LazChunks find_laz_chunks(const InputFile& file, const LasHeader& header) {
  return ChunkFinder(file, header).find();
}

}  // namespace lamina
