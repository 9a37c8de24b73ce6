#include "edit/rows.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_pipeline.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <queue>
#include <utility>

#include "base/run.h"
#include "lamina/error.h"

namespace lamina::edit {
namespace {

constexpr std::size_t kRows = 1u << 15;
constexpr std::size_t kInFlight = 8;

}  // namespace

void for_each_batch(PointSource& source, std::string_view stage, const RunContext& run,
                    const std::function<void(SampleBatch&)>& work, const std::function<void(SampleBatch&)>& take) {
  const PointSourceInfo& info = source.info();
  using Piece = std::shared_ptr<SampleBatch>;
  std::uint64_t next = 0;
  const auto begin = [&](tbb::flow_control& flow) -> Piece {
    if (next >= info.count || run.cancelled()) {
      flow.stop();
      return nullptr;
    }
    auto piece = std::make_shared<SampleBatch>();
    piece->first = next;
    if (!info.random_access) source.read(next, kRows, *piece);
    next += kRows;
    return piece;
  };
  const auto middle = [&](const Piece& piece) {
    if (info.random_access) source.read(piece->first, kRows, *piece);
    work(*piece);
    return piece;
  };
  const auto end = [&](const Piece& piece) {
    const std::uint64_t done = std::min(piece->first + kRows, info.count);
    take(*piece);
    if (run.progress) run.progress({stage, done, info.count, 0, 0});
  };
  with_threads(run.threads, [&] {
    tbb::parallel_pipeline(kInFlight, tbb::make_filter<void, Piece>(tbb::filter_mode::serial_in_order, begin) &
                                          tbb::make_filter<Piece, Piece>(tbb::filter_mode::parallel, middle) &
                                          tbb::make_filter<Piece, void>(tbb::filter_mode::serial_in_order, end));
  });
  if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
}

namespace {

constexpr std::size_t kKeyBytes = sizeof(std::uint64_t);
constexpr std::size_t kLeastRecords = 64;
constexpr std::size_t kMostRecords = std::size_t{1} << 30;

}  // namespace

/// Part of the file, sorted, and the piece of it that is in memory.
struct RecordSorter::Run {
  std::uint64_t next = 0, end = 0;  ///< bytes in the file not yet in memory
  std::vector<std::byte> piece;
  std::size_t at = 0;  ///< of the first record in `piece` not given back

  /// False when the run has ended.
  bool load(const SpillFile& file, std::size_t bytes) {
    if (at < piece.size()) return true;
    piece.resize(static_cast<std::size_t>(std::min<std::uint64_t>(bytes, end - next)));
    at = 0;
    if (piece.empty()) return false;
    file.read(next, piece);
    next += piece.size();
    return true;
  }
  [[nodiscard]] std::uint64_t key() const {
    std::uint64_t key = 0;
    std::memcpy(&key, piece.data() + at, kKeyBytes);
    return key;
  }
};

RecordSorter::RecordSorter(std::size_t record_bytes, std::size_t memory_bytes, std::string directory)
    : record_bytes_(record_bytes),
      capacity_(std::clamp(memory_bytes / (record_bytes + sizeof(Held)), kLeastRecords, kMostRecords)),
      records_(std::make_unique_for_overwrite<std::byte[]>(capacity_ * record_bytes)),
      file_(std::move(directory)) {
  held_.reserve(capacity_);  // growing would take twice the memory for a while
}

RecordSorter::~RecordSorter() = default;

void RecordSorter::add(std::span<const std::uint64_t> keys, const std::byte* records) {
  size_ += keys.size();
  while (!keys.empty()) {
    const std::size_t n = std::min(keys.size(), capacity_ - held_.size());
    std::memcpy(records_.get() + held_.size() * record_bytes_, records, n * record_bytes_);
    for (const std::uint64_t key : keys.first(n)) held_.push_back({key, static_cast<std::uint32_t>(held_.size())});
    records += n * record_bytes_;
    keys = keys.subspan(n);
    if (held_.size() == capacity_) spill();
  }
}

void RecordSorter::sort_held() {
  // By key, then by place: the order is total, so the sort need not be stable.
  tbb::parallel_sort(held_.begin(), held_.end(), [](const Held& a, const Held& b) {
    return a.key < b.key || (a.key == b.key && a.record < b.record);
  });
}

void RecordSorter::spill() {
  sort_held();
  Run run;
  run.next = file_.size();
  const std::size_t whole = kKeyBytes + record_bytes_;
  std::vector<std::byte> piece;
  for (std::size_t first = 0; first < held_.size(); first += kRows) {
    const std::size_t n = std::min<std::size_t>(kRows, held_.size() - first);
    piece.resize(n * whole);
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, n, 2048), [&](const auto& range) {
      for (std::size_t i = range.begin(); i < range.end(); ++i) {
        const Held& held = held_[first + i];
        std::memcpy(piece.data() + i * whole, &held.key, kKeyBytes);
        std::memcpy(piece.data() + i * whole + kKeyBytes, record_of(held), record_bytes_);
      }
    });
    file_.append(piece, writer_);
  }
  run.end = file_.size();
  runs_.push_back(std::move(run));
  held_.clear();
}

void RecordSorter::drain(std::size_t batch, const Take& take) {
  std::vector<std::uint64_t> keys;
  std::vector<std::byte> records;
  const auto give = [&](std::uint64_t key, const std::byte* record) {
    keys.push_back(key);
    records.insert(records.end(), record, record + record_bytes_);
    if (keys.size() < batch) return;
    take(keys, records.data());
    keys.clear();
    records.clear();
  };
  if (runs_.empty()) {
    // All of it fitted: nothing went to the file.
    sort_held();
    for (const Held& held : held_) give(held.key, record_of(held));
  } else {
    if (!held_.empty()) spill();
    file_.flush(writer_);
    file_.check(writer_.drain());
    const std::size_t whole = kKeyBytes + record_bytes_;
    const std::size_t piece =
        std::max<std::size_t>(kLeastRecords, capacity_ * record_bytes_ / runs_.size() / whole) * whole;
    records_.reset();
    using Front = std::pair<std::uint64_t, std::size_t>;  // key and run: equal keys by run, as they came
    std::priority_queue<Front, std::vector<Front>, std::greater<>> fronts;
    for (std::size_t r = 0; r < runs_.size(); ++r) {
      if (runs_[r].load(file_, piece)) fronts.emplace(runs_[r].key(), r);
    }
    while (!fronts.empty()) {
      const auto [key, r] = fronts.top();
      fronts.pop();
      Run& run = runs_[r];
      give(key, run.piece.data() + run.at + kKeyBytes);
      run.at += whole;
      if (run.load(file_, piece)) fronts.emplace(run.key(), r);
    }
  }
  if (!keys.empty()) take(keys, records.data());
}

}  // namespace lamina::edit
