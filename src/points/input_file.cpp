#include "points/input_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <memory>

#include "lamina/error.h"
#include "points/sniff.h"
#include "points/unpack.h"

namespace lamina {
namespace {

constexpr std::size_t kSpoolBytes = 256 << 10;

[[noreturn]] void cannot_read(const std::string& name, int error) {
  throw Error(ExitCode::unreadable, fmt::format("{}: cannot be read: {}", name, system_message(error)));
}

std::int64_t write_time(const struct stat& status) {
  return std::int64_t{status.st_mtim.tv_sec} * 1'000'000'000 + status.st_mtim.tv_nsec;
}

/// Bytes that have come from a pipe, up to `size`.
std::size_t receive(int fd, const std::string& name, std::byte* data, std::size_t size) {
  std::size_t have = 0;
  while (have < size) {
    const ssize_t n = ::read(fd, data + have, size - have);
    if (n < 0 && errno != EINTR) cannot_read(name, errno);
    if (n == 0) break;
    if (n > 0) have += static_cast<std::size_t>(n);
  }
  return have;
}

/// Keeps a pipe's bytes. A compressed stream is unpacked afterwards, and judged then.
InputFile spool(int fd, const std::string& name, const std::string& tmp_dir) {
  const auto buffer = std::make_unique_for_overwrite<std::byte[]>(kSpoolBytes);
  std::size_t n = receive(fd, name, buffer.get(), kSpoolBytes);
  const std::string_view start{reinterpret_cast<const char*>(buffer.get()), n};
  if (!is_gzip(start)) detect_format(start.substr(0, kSniffBytes), name);
  Spool out(name, tmp_dir);
  for (; n > 0; n = receive(fd, name, buffer.get(), kSpoolBytes)) out.write(buffer.get(), n);
  return out.finish();
}

}  // namespace

std::size_t InputFile::read(std::uint64_t offset, void* data, std::size_t size) const {
  const ReadResult result = pread_all(file.get(), data, size, offset);
  if (result.error != 0) cannot_read(name, result.error);
  struct stat status {};
  if (written && ::fstat(file.get(), &status) == 0 &&
      (write_time(status) != *written || static_cast<std::uint64_t>(status.st_size) != bytes)) {
    throw Error(ExitCode::unreadable,
                fmt::format("{}: another program wrote to it while it was read; wait until it is complete, and start "
                            "again",
                            name));
  }
  return result.bytes;
}

Descriptor open_to_read(const std::string& path) {
  return Descriptor(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
}

InputFile open_input(const std::string& path, const std::string& tmp_dir) {
  const bool standard = path == "-";
  const std::string name = standard ? "standard input" : path;
  Descriptor file = standard ? Descriptor(::fcntl(STDIN_FILENO, F_DUPFD_CLOEXEC, 0)) : open_to_read(path);
  struct stat status {};
  if (!file || ::fstat(file.get(), &status) != 0) {
    const int error = errno;
    throw Error(ExitCode::unreadable, fmt::format("{}: cannot be opened: {}{}", name, system_message(error),
                                                  error == EMFILE ? "; allow more with ulimit -n" : ""));
  }
  if (S_ISDIR(status.st_mode)) {
    throw Error(ExitCode::unreadable, fmt::format("{}: is a directory; name a point file", name));
  }
  // Standard input may be a file, too; one that another program has read the beginning of counts as a pipe.
  const bool whole_file = S_ISREG(status.st_mode) && ::lseek(file.get(), 0, SEEK_CUR) == 0;
  InputFile input = whole_file ? InputFile{} : spool(file.get(), name, tmp_dir);
  if (whole_file) {
    ::posix_fadvise(file.get(), 0, 0, POSIX_FADV_SEQUENTIAL);
    input = {std::move(file), static_cast<std::uint64_t>(status.st_size), name, write_time(status)};
  }
  char start[2];
  if (is_gzip({start, input.read(0, start, sizeof start)})) return unpack_gzip(input, tmp_dir);
  return input;
}

Spool::Spool(std::string name, const std::string& tmp_dir)
    : directory_(tmp_dir.empty() ? system_tmp_dir() : tmp_dir), file_{open_unlinked(directory_), 0, std::move(name)} {}

void Spool::write(const void* data, std::size_t bytes) {
  if (const int error = write_all(file_.file.get(), data, bytes); error != 0) {
    throw Error(ExitCode::budget,
                fmt::format("{}: no room to keep {} ({} bytes so far): {}; choose another folder for temporary files",
                            directory_, file_.name, file_.bytes, system_message(error)));
  }
  file_.bytes += bytes;
}

std::string quoted_word(std::string_view word) {
  constexpr std::size_t kLongest = 40;
  std::string text = "'";
  for (const char c : word.substr(0, kLongest)) text += c >= ' ' && c <= '~' ? c : '?';
  text += word.size() > kLongest ? "...'" : "'";
  return text;
}

}  // namespace lamina
