// Collects small records of fixed size into large writes.
#pragma once
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>

#include "files/descriptor.h"

namespace lamina {

class RecordWriter {
 public:
  /// Large enough that a system call costs nothing per record, small enough to stay in the second-level cache.
  static constexpr std::size_t kBytes = 256 << 10;

  explicit RecordWriter(std::size_t record_bytes)
      : record_bytes_(record_bytes), capacity_(std::max<std::size_t>(1, kBytes / record_bytes)) {}

  /// Gives out the next records' places piece by piece: fill(destination, first, n) writes n records, first being the
  /// number already given out in this call. Returns 0 or the errno value of a failed write.
  template <class Fill>
  int append(int fd, std::size_t count, Fill fill) {
    for (std::size_t done = 0; done < count;) {
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
    written_ += bytes;
    return write_all(fd, buffer_.get(), bytes);
  }

  [[nodiscard]] std::uint64_t written() const { return written_; }  ///< bytes, those of a failed write included

 private:
  std::size_t record_bytes_;
  std::size_t capacity_;  ///< records the buffer holds
  std::size_t used_ = 0;  ///< records in the buffer
  std::uint64_t written_ = 0;
  std::unique_ptr<std::byte[]> buffer_ = std::make_unique_for_overwrite<std::byte[]>(capacity_ * record_bytes_);
};

}  // namespace lamina
