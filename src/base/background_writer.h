// Writes to files in a thread of its own: a slow disk keeps the program waiting only when it is a queue's length
// behind.
#pragma once
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
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

}  // namespace lamina
