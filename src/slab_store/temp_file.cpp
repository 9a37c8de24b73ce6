#include "slab_store/temp_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <system_error>
#include <utility>

#include "lamina/error.h"

namespace lamina {
namespace {

std::string reason(int error) {
  return std::generic_category().message(error);
}

int open_unnamed(const std::string& directory) {
  const int descriptor = ::open(directory.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC | O_EXCL, 0600);
  // Network and overlay file systems may not know O_TMPFILE, and each refuses it in its own way.
  if (descriptor >= 0 || (errno != EOPNOTSUPP && errno != EISDIR && errno != EINVAL)) return descriptor;
  std::string name = directory + "/lamina-XXXXXX";
  const int named = ::mkostemp(name.data(), O_CLOEXEC);
  if (named >= 0) ::unlink(name.c_str());
  return named;
}

std::uint64_t file_bytes(int descriptor) {
  struct stat status {};
  return ::fstat(descriptor, &status) == 0 ? static_cast<std::uint64_t>(status.st_size) : 0;
}

}  // namespace

TempFile::TempFile(std::string directory) : directory_(directory.empty() ? "." : std::move(directory)) {
  descriptor_ = open_unnamed(directory_);
  if (descriptor_ < 0) {
    throw Error(ExitCode::budget,
                fmt::format("cannot create a temporary file in '{}': {}; choose another with --tmp-dir", directory_,
                            reason(errno)));
  }
}

TempFile::~TempFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

TempFile::TempFile(TempFile&& other) noexcept
    : directory_(std::move(other.directory_)),
      descriptor_(std::exchange(other.descriptor_, -1)),
      written_(other.written_),
      held_(std::move(other.held_)),
      held_bytes_(std::exchange(other.held_bytes_, 0)) {}

TempFile& TempFile::operator=(TempFile&& other) noexcept {
  std::swap(directory_, other.directory_);
  std::swap(descriptor_, other.descriptor_);
  std::swap(written_, other.written_);
  std::swap(held_, other.held_);
  std::swap(held_bytes_, other.held_bytes_);
  return *this;
}

void TempFile::will_read(std::uint64_t offset, std::uint64_t bytes) const {
  if (bytes > 0)
    ::posix_fadvise(descriptor_, static_cast<off_t>(offset), static_cast<off_t>(bytes), POSIX_FADV_WILLNEED);
}

void TempFile::discard() {
  ::close(std::exchange(descriptor_, -1));
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
  check(writer.write(descriptor_, std::move(held_), std::exchange(held_bytes_, 0), offset));
}

void TempFile::check(int error) const {
  if (error == 0) return;
  throw Error(ExitCode::budget,
              fmt::format("the temporary file in '{}' cannot grow beyond {} bytes: {}; free space there or choose "
                          "another with --tmp-dir",
                          directory_, file_bytes(descriptor_), reason(error)));
}

void TempFile::read(std::uint64_t offset, std::span<std::byte> bytes) const {
  while (!bytes.empty()) {
    const ssize_t got = ::pread(descriptor_, bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) {
      throw Error(
          ExitCode::budget,
          fmt::format("the temporary file in '{}' cannot be read back at byte {}: {}; choose another with --tmp-dir",
                      directory_, offset, got < 0 ? reason(errno) : "it ends there"));
    }
    offset += static_cast<std::uint64_t>(got);
    bytes = bytes.subspan(static_cast<std::size_t>(got));
  }
}

}  // namespace lamina
