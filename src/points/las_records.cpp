#include "points/las_records.h"

#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <condition_variable>
#include <cstddef>
#include <list>
#include <mutex>
#include <span>
#include <utility>

#include "lamina/error.h"
#include "laz/arithmetic_coder.h"
#include "points/laz_chunks.h"

namespace lamina {
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
