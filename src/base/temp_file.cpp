#include "base/temp_file.h"

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

TempFile::TempFile(std::string directory, std::string name, Descriptor file)
    : directory_(std::move(directory)), name_(std::move(name)), file_(std::move(file)) {}

TempFile::TempFile(std::string directory, std::string name)
    : TempFile(std::move(directory), std::move(name), Descriptor()) {
  const std::string path = directory_ + "/" + name_;
  file_ = Descriptor(::open(path.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0666));
  if (!file_) throw Error(ExitCode::budget, fmt::format("{}: cannot be written: {}", path, system_message(errno)));
}

TempFile TempFile::open(std::string directory, std::string name) {
  const std::string path = directory + "/" + name;
  Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (!file) {
    throw Error(ExitCode::unreadable,
                fmt::format("{}: cannot be read: {}; make the store again", path, system_message(errno)));
  }
  TempFile out(std::move(directory), std::move(name), std::move(file));
  out.written_ = file_bytes(out.file_.get());
  return out;
}

void TempFile::report_damage(std::uint64_t offset, const std::string& what) const {
  if (kept()) {
    throw Error(ExitCode::unreadable, fmt::format("{}/{}: is damaged at byte {} ({}); make the store again", directory_,
                                                  name_, offset, what));
  }
  throw Error(ExitCode::budget, fmt::format("the temporary file in '{}' is damaged at byte {} ({}); check the disk "
                                            "or choose another with --tmp-dir",
                                            directory_, offset, what));
}

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
  if (kept()) {
    throw Error(ExitCode::budget, fmt::format("{}/{}: cannot grow beyond {} bytes: {}; free space there", directory_,
                                              name_, file_bytes(file_.get()), system_message(error)));
  }
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
      if (kept()) report_damage(offset, got < 0 ? system_message(errno) : "it ends there");
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
