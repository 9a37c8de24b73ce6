// Point records into the chunks of a LAZ file.
#pragma once
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "laz/chunks.h"
#include "points/las_layout.h"

namespace lamina {

/// Chunks are compressed in parallel, a few at once; all the sink holds is these.
class LazRecordSink {
 public:
  explicit LazRecordSink(const LasLayout& layout);

  /// The record of the header that says how points are compressed.
  [[nodiscard]] static std::string packing(const LasLayout& layout);
  /// What stands before the first chunk: where the chunk table is, once that is known.
  [[nodiscard]] std::string lead() const;
  /// The offset of the first chunk.
  void begin(std::uint64_t offset) { begin_ = offset; }

  /// Adds `count` records: fill(to, at, n) writes n of them from the at-th on. Returns an errno value.
  template <class Fill>
  int append(int fd, std::size_t count, const Fill& fill) {
    for (std::size_t done = 0; done < count;) {
      const std::size_t n = std::min(count - done, room());
      if (waiting_.size() < (records_ + n) * layout_.bytes) waiting_.resize((records_ + n) * layout_.bytes);
      fill(waiting_.data() + records_ * layout_.bytes, done, n);
      records_ += n;
      done += n;
      if (room() > 0) continue;
      if (const int error = compress(fd); error != 0) return error;
    }
    return 0;
  }
  /// The last chunk and the table. Returns an errno value.
  int finish(int fd);
  [[nodiscard]] std::uint64_t written() const { return written_; }  ///< bytes behind lead()

 private:
  static constexpr std::size_t kChunkPoints = 50'000;  ///< as LASzip's own
  static constexpr std::size_t kChunksAtOnce = 8;

  [[nodiscard]] std::size_t room() const { return kChunkPoints * kChunksAtOnce - records_; }
  int compress(int fd);
  int put(int fd, const std::vector<std::byte>& bytes);

  laz::RecordLayout layout_;
  std::vector<std::byte> waiting_;
  std::size_t records_ = 0;  ///< waiting
  std::vector<std::uint32_t> chunk_bytes_;
  std::uint64_t begin_ = 0, written_ = 0;
  std::uint64_t table_ = 0;  ///< offset, 0: not written yet
};

}  // namespace lamina
