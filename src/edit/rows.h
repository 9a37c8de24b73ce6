// Rows of more than fits into memory: through several threads and back in order; records sorted by way of the disk, in
// runs that are merged when they are read.
#pragma once
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/spill_file.h"
#include "lamina/points.h"
#include "lamina/run.h"

namespace lamina::edit {

/// Calls work(batch) for every batch, several at once, then take(batch) in the order of the rows, one at a time.
/// Throws Error(internal, "cancelled") when the run is.
void for_each_batch(PointSource& source, std::string_view stage, const RunContext& run,
                    const std::function<void(SampleBatch&)>& work, const std::function<void(SampleBatch&)>& take);

/// Records of fixed size with a key each. Equal keys keep the order in which they came. Memory is bounded by
/// `memory_bytes`, whatever the number of records and however their keys are spread; the file takes 8 bytes and the
/// record for each. The result does not depend on the number of threads.
class RecordSorter {
 public:
  RecordSorter(std::size_t record_bytes, std::size_t memory_bytes, std::string directory);
  ~RecordSorter();
  RecordSorter(const RecordSorter&) = delete;
  RecordSorter& operator=(const RecordSorter&) = delete;

  /// Adds a record for each key. Throws Error(budget) when the directory cannot take them.
  void add(std::span<const std::uint64_t> keys, const std::byte* records);
  [[nodiscard]] std::uint64_t size() const { return size_; }

  /// Gives all records back by ascending key in batches of at most `batch`, once: take(keys, records).
  using Take = std::function<void(std::span<const std::uint64_t>, const std::byte*)>;
  void drain(std::size_t batch, const Take& take);

 private:
  struct Run;
  /// A record in memory: its key beside its place, so that sorting does not go to and fro.
  struct Held {
    std::uint64_t key;
    std::uint32_t record;
  };
  [[nodiscard]] const std::byte* record_of(const Held& held) const {
    return records_.get() + std::size_t{held.record} * record_bytes_;
  }
  void sort_held();
  void spill();

  std::size_t record_bytes_, capacity_;
  std::uint64_t size_ = 0;
  std::unique_ptr<std::byte[]> records_;
  std::vector<Held> held_;
  SpillFile file_;
  BackgroundWriter writer_{SpillFile::kBufferBytes, 4};  // ends before the file does
  std::vector<Run> runs_;
};

}  // namespace lamina::edit
