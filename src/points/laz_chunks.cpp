#include "points/las.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "base/number.h"
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

namespace {

constexpr std::size_t kNodeBytes = 32;

struct CopcNode {
  std::int32_t level = 0;
  std::array<std::int32_t, 3> at{};
  std::uint64_t offset = 0;
  std::int32_t bytes = 0, points = 0;  ///< -1 points: a further page of nodes lies there
};

CopcNode node_at(const std::byte* from) {
  CopcNode node;
  node.level = load_little<std::int32_t>(from);
  for (std::size_t k = 0; k < 3; ++k) node.at[k] = load_little<std::int32_t>(from + 4 + 4 * k);
  node.offset = load_little<std::uint64_t>(from + 16);
  node.bytes = load_little<std::int32_t>(from + 24);
  node.points = load_little<std::int32_t>(from + 28);
  return node;
}

class NodeFinder {
 public:
  NodeFinder(const InputFile& file, const CopcOctree& octree, const PointSelection& selection)
      : file_(file), octree_(octree), selection_(selection), deepest_(deepest()) {}

  std::vector<LazChunk> find() {
    // Every byte of the file is read once at most: pages that lead in a circle end.
    std::uint64_t rest = file_.bytes;
    std::vector<CopcNode> pages{
        {.offset = octree_.root_offset,
         .bytes = static_cast<std::int32_t>(std::min<std::uint64_t>(octree_.root_bytes, 1 << 30))}};
    while (!pages.empty()) {
      const CopcNode page = pages.back();
      pages.pop_back();
      const auto bytes = static_cast<std::uint64_t>(std::max(page.bytes, 0));
      if (page.offset > file_.bytes || bytes > file_.bytes - page.offset || bytes > rest) damaged(page.offset);
      rest -= bytes;
      read_page(page.offset, static_cast<std::size_t>(bytes), pages);
    }
    std::sort(nodes_.begin(), nodes_.end(), [](const LazChunk& a, const LazChunk& b) { return a.offset < b.offset; });
    std::uint64_t first = 0;
    for (LazChunk& node : nodes_) {
      node.first = first;
      first += node.points;
    }
    return std::move(nodes_);
  }

 private:
  [[noreturn]] void damaged(std::uint64_t offset) const {
    throw Error(
        ExitCode::unreadable,
        fmt::format("{}: the list of octree nodes at byte {} is damaged or cut short; without --level, --resolution "
                    "and --clip it is not needed",
                    file_.name, offset));
  }

  void read_page(std::uint64_t offset, std::size_t bytes, std::vector<CopcNode>& pages) {
    std::vector<std::byte> page(bytes);
    if (bytes % kNodeBytes != 0 || file_.read(offset, page.data(), bytes) < bytes) damaged(offset);
    for (std::size_t at = 0; at < bytes; at += kNodeBytes) {
      const CopcNode node = node_at(page.data() + at);
      if (node.level < 0 || node.level > kMostLevels) damaged(offset + at);
      if (!is_wanted(node)) continue;
      if (node.points < 0) {
        pages.push_back(node);
      } else if (node.points > 0) {
        const auto size = static_cast<std::uint64_t>(std::max(node.bytes, 0));
        if (node.offset > file_.bytes || size > file_.bytes - node.offset) damaged(offset + at);
        nodes_.push_back({node.offset, size, 0, static_cast<std::uint64_t>(node.points)});
      }
    }
  }

  [[nodiscard]] bool is_wanted(const CopcNode& node) const {
    if (node.level > deepest_) return false;
    if (!selection_.box) return true;
    const double size = std::ldexp(2 * octree_.half_size, -node.level);
    // Coordinates are rounded to the file's steps: a cube may hold points a little beyond its faces.
    const double slack = 1e-3 * size;
    for (std::size_t k = 0; k < 3; ++k) {
      const double low = octree_.centre[k] - octree_.half_size + size * node.at[k];
      if (low - slack > (*selection_.box)[1][k] || low + size + slack < (*selection_.box)[0][k]) return false;
    }
    return true;
  }

  [[nodiscard]] int deepest() const {
    if (!selection_.resolution) return kMostLevels;
    int level = 0;
    while (level < kMostLevels && std::ldexp(octree_.spacing, -level) > *selection_.resolution) ++level;
    return level;
  }

  static constexpr int kMostLevels = 31;

  const InputFile& file_;
  const CopcOctree& octree_;
  const PointSelection& selection_;
  int deepest_;
  std::vector<LazChunk> nodes_;
};

}  // namespace

CopcOctree parse_copc(std::span<const std::byte> record, const std::string& name) {
  constexpr std::size_t kBytes = 160;
  CopcOctree octree;
  bool sane = record.size() >= kBytes;
  if (sane) {
    for (std::size_t k = 0; k < 3; ++k) octree.centre[k] = load_little<double>(record.data() + 8 * k);
    octree.half_size = load_little<double>(record.data() + 24);
    octree.spacing = load_little<double>(record.data() + 32);
    octree.root_offset = load_little<std::uint64_t>(record.data() + 40);
    octree.root_bytes = load_little<std::uint64_t>(record.data() + 48);
    sane = std::all_of(octree.centre.begin(), octree.centre.end(), [](double v) { return std::isfinite(v); }) &&
           std::isfinite(octree.half_size) && octree.half_size > 0 && octree.spacing > 0;
  }
  if (!sane) throw Error(ExitCode::unreadable, fmt::format("{}: the record of its octree (COPC) makes no sense", name));
  return octree;
}

std::vector<LazChunk> find_copc_nodes(const InputFile& file, const CopcOctree& octree,
                                      const PointSelection& selection) {
  return NodeFinder(file, octree, selection).find();
}

}  // namespace lamina
