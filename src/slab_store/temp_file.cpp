#include "slab_store/temp_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "lamina/error.h"

namespace lamina {
namespace {

std::uint64_t file_bytes(int descriptor) {
  struct stat status {};
  return ::fstat(descriptor, &status) == 0 ? static_cast<std::uint64_t>(status.st_size) : 0;
}

}  // namespace

TempFile::TempFile(std::string directory)
    : directory_(directory.empty() ? "." : std::move(directory)), file_(open_unlinked(directory_)) {}

void TempFile::will_read(std::uint64_t offset, std::uint64_t bytes) const {
  if (bytes > 0)
    ::posix_fadvise(file_.get(), static_cast<off_t>(offset), static_cast<off_t>(bytes), POSIX_FADV_WILLNEED);
}

void TempFile::discard() {
  file_ = {};
  written_ = 0;
  held_.reset();
  held_bytes_ = 0;
}

std::uint64_t TempFile::append(std::span<const std::byte> bytes, BackgroundWriter& writer) {
  const std::uint64_t offset = size();
  while (!bytes.empty()) {
    if (!held_) held_ = writer.buffer();
    const std::size_t part = std::min(bytes.size(), kBufferBytes - held_bytes_);
    std::memcpy(held_.get() + held_bytes_, bytes.data(), part);
    held_bytes_ += part;
    bytes = bytes.subspan(part);
    if (held_bytes_ == kBufferBytes) flush(writer);
  }
  return offset;
}

void TempFile::flush(BackgroundWriter& writer) {
  if (held_bytes_ == 0) return;
  const std::uint64_t offset = written_;
  written_ += held_bytes_;
  check(writer.write(file_.get(), std::move(held_), std::exchange(held_bytes_, 0), offset));
}

void TempFile::check(int error) const {
  if (error == 0) return;
  throw Error(ExitCode::budget,
              fmt::format("the temporary file in '{}' cannot grow beyond {} bytes: {}; free space there or choose "
                          "another with --tmp-dir",
                          directory_, file_bytes(file_.get()), system_message(error)));
}

void TempFile::read(std::uint64_t offset, std::span<std::byte> bytes) const {
  while (!bytes.empty()) {
    const ssize_t got = ::pread(file_.get(), bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) {
      throw Error(
          ExitCode::budget,
          fmt::format("the temporary file in '{}' cannot be read back at byte {}: {}; choose another with --tmp-dir",
                      directory_, offset, got < 0 ? system_message(errno) : "it ends there"));
    }
    offset += static_cast<std::uint64_t>(got);
    bytes = bytes.subspan(static_cast<std::size_t>(got));
  }
}

}  // namespace lamina
