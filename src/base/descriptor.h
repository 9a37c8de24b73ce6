// Owned file descriptors and the few system calls every streamed file needs.
#pragma once
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>

namespace lamina {

/// Closes its descriptor. -1 holds nothing.
class Descriptor {
 public:
  Descriptor() = default;
  explicit Descriptor(int fd) : fd_(fd) {}
  ~Descriptor() { close(); }
  Descriptor(Descriptor&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    if (this != &other) {
      close();
      fd_ = std::exchange(other.fd_, -1);
    }
    return *this;
  }
  [[nodiscard]] int get() const { return fd_; }
  [[nodiscard]] explicit operator bool() const { return fd_ >= 0; }
  [[nodiscard]] int release() { return std::exchange(fd_, -1); }  ///< somebody else closes it
  /// 0 or the errno of close(): network file systems report a failed write only here.
  int close();

 private:
  int fd_ = -1;
};

/// The system's words for an errno value; safe from any thread.
std::string system_message(int error);

/// $TMPDIR, else /tmp.
std::string system_tmp_dir();

/// An unnamed read-write file in `directory`, gone when closed whatever happens to the program.
/// Throws Error(budget) naming the directory and the reason.
Descriptor open_unlinked(const std::string& directory);

/// Writes everything, through interruptions and short writes. 0 or an errno value.
int write_all(int fd, const void* data, std::size_t bytes);
int pwrite_all(int fd, const void* data, std::size_t bytes, std::uint64_t offset);

/// Reads until `bytes` are there or the file ends.
struct ReadResult {
  std::size_t bytes = 0;
  int error = 0;  ///< errno value, 0 when all is well
};
ReadResult pread_all(int fd, void* data, std::size_t bytes, std::uint64_t offset);

/// Copies `bytes` from the beginning of `from` to the current position of `to` (a file, pipe or device), inside the
/// kernel where it can. 0 or an errno value; EIO when `from` is shorter.
int copy_all(int from, std::uint64_t bytes, int to);

/// The same, and gives the disk space of what has been copied back as it goes (where the file system can): `from` holds
/// nothing of use afterwards. `to` is a regular file: a pipe may still refer to what is given back.
int move_all(int from, std::uint64_t bytes, int to);

#ifndef LAMINA_READ_BYTES
#define LAMINA_READ_BYTES (128 << 10)
#endif

/// How much readers take from a file at once: what stays in the second-level cache until it is converted. The fuzzers
/// read by fewer (tests/fuzz/CMakeLists.txt), so that lines, rows and headers cross the border of two pieces as often
/// in their small files as in large ones.
inline constexpr std::size_t kReadBytes = LAMINA_READ_BYTES;

}  // namespace lamina
