#include "slab_store/temp_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <system_error>
#include <utility>

#include "lamina/error.h"

namespace lamina {
namespace {

constexpr std::size_t kHeldBytes = 1U << 17;

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
      held_(std::move(other.held_)) {}

TempFile& TempFile::operator=(TempFile&& other) noexcept {
  std::swap(directory_, other.directory_);
  std::swap(descriptor_, other.descriptor_);
  std::swap(written_, other.written_);
  std::swap(held_, other.held_);
  return *this;
}

void TempFile::discard() {
  ::close(std::exchange(descriptor_, -1));
  written_ = 0;
  held_ = {};
}

std::uint64_t TempFile::append(std::span<const std::byte> bytes) {
  const std::uint64_t offset = size();
  held_.reserve(kHeldBytes);
  while (!bytes.empty()) {
    const std::size_t part = std::min(bytes.size(), kHeldBytes - held_.size());
    held_.insert(held_.end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(part));
    bytes = bytes.subspan(part);
    if (held_.size() == kHeldBytes) flush();
  }
  return offset;
}

void TempFile::flush() {
  std::span<const std::byte> bytes = held_;
  while (!bytes.empty()) {
    const ssize_t count = ::pwrite(descriptor_, bytes.data(), bytes.size(), static_cast<off_t>(written_));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) {
      throw Error(ExitCode::budget,
                  fmt::format("the temporary file in '{}' cannot grow beyond {} bytes: {}; free space there or choose "
                              "another with --tmp-dir",
                              directory_, written_, count < 0 ? reason(errno) : "nothing was written"));
    }
    written_ += static_cast<std::uint64_t>(count);
    bytes = bytes.subspan(static_cast<std::size_t>(count));
  }
  held_.clear();
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
