// Collects small records of fixed size into large writes.
#pragma once
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>

#include "base/background_writer.h"

namespace lamina {

/// Records of one file, written behind the caller's back.
class RecordWriter {
 public:
  /// Large enough that a system call costs nothing per record, small enough to stay in the second-level cache.
  static constexpr std::size_t kBytes = 256 << 10;

  /// `writer`'s buffers are of kBytes; it is drained before the file is looked at.
  RecordWriter(BackgroundWriter& writer, std::size_t record_bytes)
      : writer_(writer), record_bytes_(record_bytes), capacity_(std::max<std::size_t>(1, kBytes / record_bytes)) {}

  /// Gives out the next records' places piece by piece: fill(destination, first, n) writes n records, first being the
  /// number already given out in this call. Returns 0 or the errno value of a failed write, maybe an earlier one.
  template <class Fill>
  int append(int fd, std::size_t count, Fill fill) {
    for (std::size_t done = 0; done < count;) {
      if (!buffer_) buffer_ = writer_.buffer();
      const std::size_t n = std::min(count - done, capacity_ - used_);
      fill(buffer_.get() + used_ * record_bytes_, done, n);
      used_ += n;
      done += n;
      if (used_ == capacity_) {
        if (const int error = flush(fd); error != 0) return error;
      }
    }
    return 0;
  }

  int flush(int fd) {
    const std::size_t bytes = std::exchange(used_, 0) * record_bytes_;
    if (bytes == 0) return 0;
    written_ += bytes;
    return writer_.write(fd, std::move(buffer_), bytes);
  }

  [[nodiscard]] std::uint64_t written() const { return written_; }  ///< bytes, those of a failed write included

 private:
  BackgroundWriter& writer_;
  std::size_t record_bytes_;
  std::size_t capacity_;  ///< records the buffer holds
  std::size_t used_ = 0;  ///< records in the buffer
  std::uint64_t written_ = 0;
  BackgroundWriter::Buffer buffer_;
};

/// Records of a file that nothing else is written to. Must end before the file does.
class SoleRecordWriter {
 public:
  explicit SoleRecordWriter(std::size_t record_bytes)
      : background_(std::max(RecordWriter::kBytes, record_bytes), 4), records_(background_, record_bytes) {}

  template <class Fill>
  int append(int fd, std::size_t count, Fill fill) {
    return records_.append(fd, count, std::move(fill));
  }
  /// Everything is in the file when this returns 0.
  int flush(int fd) {
    const int error = records_.flush(fd);
    const int late = background_.drain();
    return error != 0 ? error : late;
  }
  [[nodiscard]] std::uint64_t written() const { return records_.written(); }

 private:
  BackgroundWriter background_;
  RecordWriter records_;
};

}  // namespace lamina
