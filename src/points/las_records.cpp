#include "points/las.h"

#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <condition_variable>
#include <cstddef>
#include <list>
#include <mutex>
#include <span>
#include <utility>
#include <vector>

#include "base/number.h"
#include "lamina/error.h"
#include "laz/arithmetic_coder.h"

namespace lamina {
namespace {

/// A part of a point that has a coder of its own.
struct LazItem {
  enum Kind : std::uint16_t {
    bytes = 0,
    point10 = 6,
    gps_time = 7,
    colours = 8,
    point14 = 10,
    colours14 = 11,
    colours_infrared = 12,
    bytes14 = 14,
  };
  std::uint16_t kind = 0, size = 0, version = 0;
};

/// What points of a format are made of, extra bytes at the end.
std::vector<LazItem> items_of(int point_format, std::size_t extra_bytes) {
  std::vector<LazItem> items;
  const bool layered = point_format >= 6;
  items.push_back(layered ? LazItem{LazItem::point14, 30} : LazItem{LazItem::point10, 20});
  if (point_format == 1 || point_format == 3) items.push_back({LazItem::gps_time, 8});
  if (point_format == 2 || point_format == 3) items.push_back({LazItem::colours, 6});
  if (point_format == 7) items.push_back({LazItem::colours14, 6});
  if (point_format == 8) items.push_back({LazItem::colours_infrared, 8});
  if (extra_bytes > 0) {
    items.push_back({layered ? LazItem::bytes14 : LazItem::bytes, static_cast<std::uint16_t>(extra_bytes)});
  }
  return items;
}

std::size_t standard_bytes(int point_format) {
  std::size_t bytes = 0;
  for (const LazItem& item : items_of(point_format, 0)) bytes += item.size;
  return bytes;
}

}  // namespace

LazPacking parse_laz_packing(std::span<const std::byte> record, int point_format, std::size_t record_bytes,
                             const std::string& name) {
  const auto refuse = [&](const std::string& what) {
    throw Error(ExitCode::unreadable, fmt::format("{}: {}", name, what));
  };
  if (point_format == 4 || point_format == 5 || point_format >= 9) {
    refuse(
        fmt::format("compressed points of format {} (wave packets) are not read; leave the waves out: las2las -i "
                    "FILE -remove_all_evlrs -set_point_type {} -o OTHER.laz",
                    point_format,
                    point_format == 4   ? 1
                    : point_format == 5 ? 3
                    : point_format == 9 ? 6
                                        : 8));
  }
  constexpr std::size_t kHead = 34, kItem = 6;
  if (record.size() < kHead) {
    refuse(fmt::format("the record '{}', which says how points are compressed, is {}", kLazUser,
                       record.empty() ? "missing" : "cut short"));
  }
  constexpr unsigned kPointwise = 1, kChunked = 2, kLayered = 3;
  const unsigned compressor = load_little<std::uint16_t>(record.data());
  const unsigned coder = load_little<std::uint16_t>(record.data() + 2);
  const bool layered = point_format >= 6;
  const bool fits = layered ? compressor == kLayered : compressor == kPointwise || compressor == kChunked;
  if (!fits || coder != 0) {
    refuse(fmt::format("points of format {} are compressed by method {}.{}, which is not known", point_format,
                       compressor, coder));
  }
  LazPacking packing;
  packing.layered = layered;
  packing.chunked = compressor != kPointwise;
  packing.chunk_points = load_little<std::uint32_t>(record.data() + 12);
  if (packing.chunk_points == 0) packing.chunk_points = LazPacking::kVariable;
  packing.layout = {.bytes = record_bytes,
                    .extra_bytes = record_bytes - standard_bytes(point_format),
                    .gps_time = point_format == 1 || point_format == 3,
                    .colours = point_format == 2 || point_format == 3 || point_format == 7 || point_format == 8,
                    .infrared = point_format == 8};
  const std::vector<LazItem> wanted = items_of(point_format, packing.layout.extra_bytes);
  const std::size_t items = load_little<std::uint16_t>(record.data() + 32);
  if (items != wanted.size() || record.size() < kHead + kItem * items) {
    refuse(fmt::format("points of format {} have {} compressed items, not {}", point_format, wanted.size(), items));
  }
  for (std::size_t i = 0; i < items; ++i) {
    const std::byte* at = record.data() + kHead + kItem * i;
    const LazItem item{load_little<std::uint16_t>(at), load_little<std::uint16_t>(at + 2),
                       load_little<std::uint16_t>(at + 4)};
    if (item.kind != wanted[i].kind || item.size != wanted[i].size) {
      refuse(fmt::format("compressed item {} of the points is of kind {} and {} bytes; format {} has kind {} and {}", i,
                         item.kind, item.size, point_format, wanted[i].kind, wanted[i].size));
    }
    if (!layered && item.version == 1) {
      refuse("points are compressed as LASzip did before 2011; compress them anew: laszip -i FILE -o OTHER.laz");
    }
    if (layered ? item.version < 2 || item.version > 4 : item.version != 2) {
      refuse(fmt::format("compressed item {} of the points is of version {}, which is not known", i, item.version));
    }
    packing.layout.channels_apart = packing.layout.channels_apart || (layered && item.version == 4);
  }
  return packing;
}

std::string laz_packing_record(int point_format, std::size_t record_bytes, std::uint32_t chunk_points) {
  const std::vector<LazItem> items = items_of(point_format, record_bytes - standard_bytes(point_format));
  constexpr std::uint16_t kLayered = 3, kArithmetic = 0;
  constexpr std::uint16_t kVersion = 3;  // of items; any program of the last years reads it
  std::string data;
  append_little(data, kLayered);
  append_little(data, kArithmetic);
  data += {3, 4};  // LASzip's version that this is like
  append_little(data, std::uint16_t{3});
  append_little(data, std::uint32_t{0});  // options
  append_little(data, chunk_points);
  append_little(data, std::int64_t{-1});  // no special records behind the points
  append_little(data, std::int64_t{-1});
  append_little(data, static_cast<std::uint16_t>(items.size()));
  for (const LazItem& item : items) {
    append_little(data, item.kind);
    append_little(data, item.size);
    append_little(data, kVersion);
  }
  std::string record(2, '\0');
  std::string user = kLazUser;
  user.resize(16);
  record += user;
  append_little(record, kLazRecord);
  append_little(record, static_cast<std::uint16_t>(data.size()));
  record += std::string(32, '\0');
  return record + data;
}

namespace {

class PlainRecords final : public LasRecords {
 public:
  PlainRecords(const InputFile& file, const LasHeader& header)
      : file_(file), layout_{header.data, header.record_bytes, false} {
    count_ = header.count;
  }
  void read(RowRange rows, const laz::WantedBytes&, const TakeRows& take) const override {
    read_row_blocks(file_, layout_, rows, take);
  }

 private:
  const InputFile& file_;
  BinaryRows layout_;
};

using Records = std::shared_ptr<const std::byte[]>;

/// Decoded chunks of late, two more than there are threads. Threads that read one file from its beginning to its end
/// want the same chunk at the same time: one decodes it, and those that would wait for it decode the chunks behind it
/// meanwhile.
class ChunkCache {
 public:
  /// The records of chunk `number` of `chunks`, by decode(number) unless they are there.
  template <class Decode>
  Records get(std::size_t number, std::size_t chunks, const laz::WantedBytes& wanted, const Decode& decode) {
    const auto capacity = static_cast<std::size_t>(tbb::this_task_arena::max_concurrency()) + 2;
    const std::size_t end = std::min(chunks, number + capacity);
    std::unique_lock lock(mutex_);
    for (;;) {
      const auto known = find(number, wanted);
      if (known == entries_.end()) return make({number, wanted}, capacity, decode, lock);
      if (known->records != nullptr) {
        entries_.splice(entries_.begin(), entries_, known);
        return known->records;
      }
      std::size_t ahead = number + 1;
      while (ahead < end && find(ahead, wanted) != entries_.end()) ++ahead;
      if (ahead == end) {
        done_.wait(lock);
        continue;
      }
      try {
        make({ahead, wanted}, capacity, decode, lock);
      } catch (const Error&) {
        // Whoever wants that chunk will be told.
      }
    }
  }

 private:
  struct Entry {
    std::size_t number;
    laz::WantedBytes wanted;
    Records records{};  ///< null while some thread decodes them
  };
  using Entries = std::list<Entry>;

  Entries::iterator find(std::size_t number, const laz::WantedBytes& wanted) {
    return std::find_if(entries_.begin(), entries_.end(),
                        [&](const Entry& e) { return e.number == number && e.wanted == wanted; });
  }

  /// Decodes a chunk while the lock is open.
  template <class Decode>
  Records make(Entry entry, std::size_t capacity, const Decode& decode, std::unique_lock<std::mutex>& lock) {
    entries_.push_front(std::move(entry));
    const auto place = entries_.begin();
    forget_all_but(capacity);
    lock.unlock();
    Records records;
    try {
      records = decode(place->number);
    } catch (...) {
      lock.lock();
      entries_.erase(place);
      done_.notify_all();
      throw;
    }
    lock.lock();
    place->records = records;
    done_.notify_all();
    return records;
  }

  void forget_all_but(std::size_t capacity) {
    for (auto at = entries_.end(); entries_.size() > capacity && at != entries_.begin();) {
      --at;
      if (at->records != nullptr) at = entries_.erase(at);
    }
  }

  Entries entries_;  ///< last used first
  std::mutex mutex_;
  std::condition_variable done_;
};

class LazRecords final : public LasRecords {
 public:
  LazRecords(const InputFile& file, const LasHeader& header, LazChunks found)
      : file_(file), packing_(*header.packing), chunks_(std::move(found.chunks)) {
    count_ = chunks_.empty() ? 0 : chunks_.back().first + chunks_.back().points - found.uncounted;
    if (found.without_table && count_ > 0) {
      remarks_.push_back(
          fmt::format("{}: the chunk table is missing: {} chunks were found one by one", file.name, chunks_.size()));
    }
    if (found.uncounted > 0) {
      remarks_.push_back(fmt::format("{}: the header counts {} points; the chunks behind them hold {} more, left out",
                                     file.name, count_, found.uncounted));
    }
    if (count_ < header.count) {
      remarks_.push_back(fmt::format("{}: {} of {} points, those of {} octree nodes", file.name, count_, header.count,
                                     chunks_.size()));
    }
  }

  void read(RowRange rows, const laz::WantedBytes& wanted, const TakeRows& take) const override {
    auto chunk = std::upper_bound(chunks_.begin(), chunks_.end(), rows.first,
                                  [](std::uint64_t row, const LazChunk& c) { return row < c.first; });
    if (rows.count == 0) return;
    --chunk;
    for (std::size_t done = 0; done < rows.count; ++chunk) {
      const auto number = static_cast<std::size_t>(chunk - chunks_.begin());
      const Records records =
          cache_.get(number, chunks_.size(), wanted, [&](std::size_t n) { return decode(chunks_[n], wanted); });
      const std::uint64_t from = rows.first + done - chunk->first;
      const auto count = static_cast<std::size_t>(std::min<std::uint64_t>(rows.count - done, chunk->points - from));
      take(records.get() + from * packing_.layout.bytes, done, count);
      done += count;
    }
  }

 private:
  [[nodiscard]] Records decode(const LazChunk& chunk, const laz::WantedBytes& wanted) const {
    const auto bytes = static_cast<std::size_t>(chunk.bytes);
    const auto code = std::make_unique_for_overwrite<std::byte[]>(bytes);
    const std::span<const std::byte> there(code.get(), file_.read(chunk.offset, code.get(), bytes));
    const auto points = static_cast<std::size_t>(chunk.points);
    const auto records = std::make_shared_for_overwrite<std::byte[]>(points * packing_.layout.bytes);
    try {
      if (there.size() < bytes) throw laz::Damaged("it is cut short");
      if (packing_.layered) {
        laz::decode_layered(packing_.layout, there, wanted, points, records.get());
      } else {
        laz::decode_pointwise(packing_.layout, there, points, records.get());
      }
    } catch (const laz::Damaged& damage) {
      throw Error(ExitCode::unreadable,
                  fmt::format("{}: the chunk of points {} to {} (at byte {}) is damaged: {}", file_.name, chunk.first,
                              chunk.first + chunk.points - 1, chunk.offset, damage.what()));
    }
    return records;
  }

  const InputFile& file_;
  const LazPacking& packing_;
  std::vector<LazChunk> chunks_;
  mutable ChunkCache cache_;
};

}  // namespace

std::unique_ptr<LasRecords> open_las_records(const InputFile& file, const LasHeader& header,
                                             const PointSelection& selection) {
  if (header.octree.empty() && selection.resolution) {
    throw Error(ExitCode::usage,
                fmt::format("{}: has no octree to take levels of; --resolution is for COPC", file.name));
  }
  if (!header.packing) return std::make_unique<PlainRecords>(file, header);
  LazChunks found;
  if (!header.octree.empty() && (selection.resolution || selection.box)) {
    found.chunks = find_copc_nodes(file, parse_copc(header.octree, file.name), selection);
    for (const LazChunk& node : found.chunks) require_sensible(node, file, header);
  } else {
    found = find_laz_chunks(file, header);
  }
  return std::make_unique<LazRecords>(file, header, std::move(found));
}

}  // namespace lamina
