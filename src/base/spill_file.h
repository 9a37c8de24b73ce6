// Temporary files, and the thread that writes them and others.
#pragma once
#include <algorithm>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "base/descriptor.h"

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

// What does not fit in memory, on disk: written from its beginning to its end and read back from anywhere.

/// Temporary and without a name, gone when it is closed, however the program ends; or named and kept, as a store's are.
class SpillFile {
 public:
  static constexpr std::size_t kBufferBytes = 1U << 17;

  /// Throws Error(budget) naming the directory when no file can be made in it.
  explicit SpillFile(std::string directory);
  /// A file that stays, made anew. Throws as above.
  SpillFile(std::string directory, std::string name);
  /// One that stayed, for reading. Throws Error(unreadable) naming it where it is not there.
  static SpillFile open(std::string directory, std::string name);

  /// Adds bytes at the end and returns their offset. They are written in large pieces at whole pages: small writes cost
  /// the kernel twice the work. Throws Error(budget) naming the directory and the bytes written so far when a write has
  /// failed.
  std::uint64_t append(std::span<const std::byte> bytes) { return append(bytes, nullptr); }
  /// The same, written later by `writer` (buffers of kBufferBytes).
  std::uint64_t append(std::span<const std::byte> bytes, BackgroundWriter& writer) { return append(bytes, &writer); }
  /// Writes what append() still holds; before that (and before the writer is drained) it cannot be read. Throws as
  /// append() does.
  void flush() { flush(nullptr); }
  void flush(BackgroundWriter& writer) { flush(&writer); }
  /// Throws what a failed write is worth. `error`: of the writer, 0 for none.
  void check(int error) const;

  /// Fills `bytes` from `offset`; safe from several threads. Throws Error(budget) when they cannot be read.
  void read(std::uint64_t offset, std::span<std::byte> bytes) const;
  /// Gives all of it to `take`, in order, `piece` bytes at a time; the last piece may be shorter. Throws as read()
  /// does.
  void read_through(std::size_t piece, const std::function<void(std::span<const std::byte>)>& take) const;
  /// Starts reading into the system's cache.
  void will_read(std::uint64_t offset, std::uint64_t bytes) const;

  /// Gives back the disk space of what lies before `offset`, where the file system can. A flushed file of which nothing
  /// is left is empty again: begin() and size() are 0.
  void discard_before(std::uint64_t offset);
  /// Gives all disk space back; nothing can be appended or read any more.
  void discard();
  [[nodiscard]] std::uint64_t begin() const { return begin_; }  ///< offset of the first byte that was not discarded
  [[nodiscard]] std::uint64_t size() const { return written_ + held_bytes_; }  ///< offset of the next byte

  /// Throws that bytes at `offset` are not what was written; `what`: they hold.
  [[noreturn]] void report_damage(std::uint64_t offset, const std::string& what) const;
  [[nodiscard]] bool kept() const { return !name_.empty(); }

 private:
  SpillFile(std::string directory, std::string name, Descriptor file);
  std::uint64_t append(std::span<const std::byte> bytes, BackgroundWriter* writer);
  void flush(BackgroundWriter* writer);

  std::string directory_, name_;  ///< no name: temporary
  Descriptor file_;
  std::uint64_t begin_ = 0, written_ = 0;
  BackgroundWriter::Buffer held_;
  std::size_t held_bytes_ = 0;
};

}  // namespace lamina
