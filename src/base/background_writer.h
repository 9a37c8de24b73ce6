// Writes to files in a thread of its own: a slow disk keeps the program waiting only when it is a queue's length
// behind.
#pragma once
#include <algorithm>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

namespace lamina {

/// Buffers of one size that go round: filled by the caller, written in the order they are handed over, handed out
/// again. One thread at a time may call.
class BackgroundWriter {
 public:
  using Buffer = std::unique_ptr<std::byte[]>;

  /// At most `most_buffers` (>= 1) of `buffer_bytes` are on their way at once.
  BackgroundWriter(std::size_t buffer_bytes, std::size_t most_buffers);
  ~BackgroundWriter();  ///< writes what it was given
  BackgroundWriter(const BackgroundWriter&) = delete;
  BackgroundWriter& operator=(const BackgroundWriter&) = delete;

  [[nodiscard]] std::size_t buffer_bytes() const { return buffer_bytes_; }
  /// An empty buffer.
  [[nodiscard]] Buffer buffer();
  /// Hands over the first `bytes` of a buffer, to be written to `fd` at `offset`, or where the file stands. `fd` stays
  /// open until drain(). Waits while too many are on their way. Returns 0, or the errno value of the first write to any
  /// file that has failed so far: then nothing is written any more.
  int write(int fd, Buffer buffer, std::size_t bytes, std::optional<std::uint64_t> offset = std::nullopt);
  /// Waits until all is written. 0 or the errno value as above.
  int drain();
  /// The file whose write failed first; -1: none did.
  [[nodiscard]] int failed_file();

 private:
  struct Job {
    int fd;
    Buffer buffer;
    std::size_t bytes;
    std::optional<std::uint64_t> offset;
  };
  void work();

  std::size_t buffer_bytes_, most_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Job> jobs_;  ///< the front one is being written
  std::vector<Buffer> spares_;
  std::size_t made_ = 0;  ///< buffers
  int error_ = 0;
  int failed_file_ = -1;
  bool ending_ = false;
  std::thread thread_;  ///< started by the first write
};

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
