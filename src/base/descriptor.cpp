#include "base/descriptor.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/sendfile.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <system_error>

#include "lamina/error.h"
#include "lamina/file_ending.h"

namespace lamina {
namespace {

/// Largest request handed to the kernel at once; Linux cuts larger ones itself.
constexpr std::size_t kLargestRequest = std::size_t{1} << 30;

/// Copies with `step(bytes left) -> bytes copied, 0 at the end, -1` until done or it gives up; returns what is left.
template <class Step>
std::uint64_t copy_while(std::uint64_t left, Step step) {
  while (left > 0) {
    const ssize_t n = step(static_cast<std::size_t>(std::min<std::uint64_t>(left, kLargestRequest)));
    if (n > 0) {
      left -= static_cast<std::uint64_t>(n);
    } else if (n == 0 || errno != EINTR) {
      break;
    }
  }
  return left;
}

int copy_through_memory(int from, off_t offset, std::uint64_t left, int to) {
  constexpr std::size_t kBytes = 256 << 10;
  const auto buffer = std::make_unique_for_overwrite<std::byte[]>(kBytes);
  while (left > 0) {
    const auto want = static_cast<std::size_t>(std::min<std::uint64_t>(left, kBytes));
    const ReadResult got = pread_all(from, buffer.get(), want, static_cast<std::uint64_t>(offset));
    if (got.error != 0) return got.error;
    if (got.bytes < want) return EIO;
    if (const int error = write_all(to, buffer.get(), want); error != 0) return error;
    offset += static_cast<off_t>(want);
    left -= want;
  }
  return 0;
}

int copy_range(int from, std::uint64_t begin, std::uint64_t bytes, int to) {
  // Each way goes on where the one before gave up; only the last, which works on everything, reports why.
  auto offset = static_cast<off_t>(begin);
  std::uint64_t left =
      copy_while(bytes, [&](std::size_t n) { return ::copy_file_range(from, &offset, to, nullptr, n, 0); });
  left = copy_while(left, [&](std::size_t n) { return ::sendfile(to, from, &offset, n); });
  return copy_through_memory(from, offset, left, to);
}

}  // namespace

int Descriptor::close() {
  if (fd_ < 0) return 0;
  return ::close(std::exchange(fd_, -1)) == 0 || errno == EINTR ? 0 : errno;
}

std::string system_message(int error) {
  return std::generic_category().message(error);
}

std::string system_tmp_dir() {
  const char* chosen = std::getenv("TMPDIR");
  return chosen != nullptr && *chosen != '\0' ? chosen : "/tmp";
}

Descriptor open_unlinked(const std::string& directory) {
  Descriptor file(::open(directory.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600));
  if (!file && (errno == EOPNOTSUPP || errno == EISDIR || errno == EINVAL)) {
    // The file system knows no unnamed files: a named one is unlinked at once.
    std::string name = directory + "/.lamina-XXXXXX";
    file = Descriptor(::mkostemp(name.data(), O_CLOEXEC));
    if (file) ::unlink(name.c_str());
  }
  if (!file) {
    throw Error(
        ExitCode::budget,
        fmt::format(
            "{}: cannot make a temporary file here: {}; choose another folder for temporary files with --tmp-dir",
            directory, system_message(errno)));
  }
  return file;
}

int write_all(int fd, const void* data, std::size_t bytes) {
  const auto* p = static_cast<const std::byte*>(data);
  while (bytes > 0) {
    const ssize_t n = ::write(fd, p, std::min(bytes, kLargestRequest));
    if (n < 0 && errno != EINTR) return errno;
    if (n == 0) return ENOSPC;
    if (n > 0) {
      p += n;
      bytes -= static_cast<std::size_t>(n);
    }
  }
  return 0;
}

int pwrite_all(int fd, const void* data, std::size_t bytes, std::uint64_t offset) {
  const auto* p = static_cast<const std::byte*>(data);
  while (bytes > 0) {
    const ssize_t n = ::pwrite(fd, p, std::min(bytes, kLargestRequest), static_cast<off_t>(offset));
    if (n < 0 && errno != EINTR) return errno;
    if (n == 0) return ENOSPC;
    if (n > 0) {
      p += n;
      bytes -= static_cast<std::size_t>(n);
      offset += static_cast<std::uint64_t>(n);
    }
  }
  return 0;
}

ReadResult pread_all(int fd, void* data, std::size_t bytes, std::uint64_t offset) {
  auto* p = static_cast<std::byte*>(data);
  ReadResult result;
  while (result.bytes < bytes) {
    const ssize_t n = ::pread(fd, p + result.bytes, std::min(bytes - result.bytes, kLargestRequest),
                              static_cast<off_t>(offset + result.bytes));
    if (n < 0 && errno != EINTR) {
      result.error = errno;
      break;
    }
    if (n == 0) break;
    if (n > 0) result.bytes += static_cast<std::size_t>(n);
  }
  return result;
}

int copy_all(int from, std::uint64_t bytes, int to) {
  return copy_range(from, 0, bytes, to);
}

int move_all(int from, std::uint64_t bytes, int to) {
  constexpr std::uint64_t kPiece = 64 << 20;
  for (std::uint64_t done = 0; done < bytes; done += kPiece) {
    const std::uint64_t piece = std::min(kPiece, bytes - done);
    if (const int error = copy_range(from, done, piece, to); error != 0) return error;
    // Where holes are unknown the space comes back when the file is closed.
    (void)::fallocate(from, FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE, static_cast<off_t>(done),
                      static_cast<off_t>(piece));
  }
  return 0;
}

namespace {

// Not of the locale: a Turkish one has other small letters.
char small(char c) {
  return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
}

}  // namespace

std::string file_ending(std::string_view path) {
  std::string ending = std::filesystem::path(path).extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(), small);
  return ending;
}

std::string packed_ending(std::string_view path) {
  std::string ending = file_ending(path);
  return ending == ".gz" ? file_ending(path.substr(0, path.size() - ending.size())) : ending;
}

}  // namespace lamina
