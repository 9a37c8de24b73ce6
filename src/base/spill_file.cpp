#include "base/spill_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <memory>
#include <utility>
#include <vector>

#include "base/descriptor.h"
#include "lamina/error.h"

namespace lamina {

BackgroundWriter::BackgroundWriter(std::size_t buffer_bytes, std::size_t most_buffers)
    : buffer_bytes_(buffer_bytes), most_(most_buffers) {}

BackgroundWriter::~BackgroundWriter() {
  if (!thread_.joinable()) return;
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

BackgroundWriter::Buffer BackgroundWriter::buffer() {
  const std::lock_guard lock(mutex_);
  if (spares_.empty()) {
    spares_.reserve(++made_);  // the thread has nobody to tell that memory is out
    return std::make_unique_for_overwrite<std::byte[]>(buffer_bytes_);
  }
  Buffer spare = std::move(spares_.back());
  spares_.pop_back();
  return spare;
}

int BackgroundWriter::write(int fd, Buffer buffer, std::size_t bytes, std::optional<std::uint64_t> offset) {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return jobs_.size() < most_; });
  if (!thread_.joinable()) thread_ = std::thread([this] { work(); });
  jobs_.push_back({fd, std::move(buffer), bytes, offset});
  const int error = error_;
  lock.unlock();  // else who is woken would wait for it
  changed_.notify_all();
  return error;
}

int BackgroundWriter::drain() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return jobs_.empty(); });
  return error_;
}

int BackgroundWriter::failed_file() {
  const std::lock_guard lock(mutex_);
  return failed_file_;
}

void BackgroundWriter::work() {
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [&] { return ending_ || !jobs_.empty(); });
    if (jobs_.empty()) return;
    const Job& job = jobs_.front();
    if (error_ == 0) {
      lock.unlock();
      const int error = job.offset ? pwrite_all(job.fd, job.buffer.get(), job.bytes, *job.offset)
                                   : write_all(job.fd, job.buffer.get(), job.bytes);
      lock.lock();
      error_ = error;
      if (error != 0) failed_file_ = job.fd;
    }
    spares_.push_back(std::move(jobs_.front().buffer));
    jobs_.pop_front();
    changed_.notify_all();
  }
}

namespace {

std::uint64_t file_bytes(int descriptor) {
  struct stat status {};
  return ::fstat(descriptor, &status) == 0 ? static_cast<std::uint64_t>(status.st_size) : 0;
}

}  // namespace

SpillFile::SpillFile(std::string directory)
    : directory_(directory.empty() ? "." : std::move(directory)), file_(open_unlinked(directory_)) {}

SpillFile::SpillFile(std::string directory, std::string name, Descriptor file)
    : directory_(std::move(directory)), name_(std::move(name)), file_(std::move(file)) {}

SpillFile::SpillFile(std::string directory, std::string name)
    : SpillFile(std::move(directory), std::move(name), Descriptor()) {
  const std::string path = directory_ + "/" + name_;
  file_ = Descriptor(::open(path.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0666));
  if (!file_) throw Error(ExitCode::budget, fmt::format("{}: cannot be written: {}", path, system_message(errno)));
}

SpillFile SpillFile::open(std::string directory, std::string name) {
  const std::string path = directory + "/" + name;
  Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (!file) {
    throw Error(ExitCode::unreadable,
                fmt::format("{}: cannot be read: {}; make the store again", path, system_message(errno)));
  }
  SpillFile out(std::move(directory), std::move(name), std::move(file));
  out.written_ = file_bytes(out.file_.get());
  return out;
}

void SpillFile::report_damage(std::uint64_t offset, const std::string& what) const {
  if (kept()) {
    throw Error(ExitCode::unreadable, fmt::format("{}/{}: is damaged at byte {} ({}); make the store again", directory_,
                                                  name_, offset, what));
  }
  throw Error(ExitCode::budget, fmt::format("the temporary file in '{}' is damaged at byte {} ({}); check the disk "
                                            "or choose another with --tmp-dir",
                                            directory_, offset, what));
}

void SpillFile::will_read(std::uint64_t offset, std::uint64_t bytes) const {
  if (bytes > 0)
    ::posix_fadvise(file_.get(), static_cast<off_t>(offset), static_cast<off_t>(bytes), POSIX_FADV_WILLNEED);
}

void SpillFile::discard_before(std::uint64_t offset) {
  if (offset <= begin_) return;
  // Where holes are unknown the space comes back with the file's end.
  (void)::fallocate(file_.get(), FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE, static_cast<off_t>(begin_),
                    static_cast<off_t>(offset - begin_));
  begin_ = offset;
  if (begin_ == size() && held_bytes_ == 0 && ::ftruncate(file_.get(), 0) == 0) begin_ = written_ = 0;
}

void SpillFile::discard() {
  file_ = {};
  begin_ = written_ = 0;
  held_.reset();
  held_bytes_ = 0;
}

std::uint64_t SpillFile::append(std::span<const std::byte> bytes, BackgroundWriter* writer) {
  const std::uint64_t offset = size();
  while (!bytes.empty()) {
    if (!held_) {
      held_ = writer != nullptr ? writer->buffer() : std::make_unique_for_overwrite<std::byte[]>(kBufferBytes);
    }
    const std::size_t part = std::min(bytes.size(), kBufferBytes - held_bytes_);
    std::memcpy(held_.get() + held_bytes_, bytes.data(), part);
    held_bytes_ += part;
    bytes = bytes.subspan(part);
    if (held_bytes_ == kBufferBytes) flush(writer);
  }
  return offset;
}

void SpillFile::flush(BackgroundWriter* writer) {
  if (held_bytes_ == 0) return;
  const std::uint64_t offset = written_;
  const std::size_t bytes = std::exchange(held_bytes_, 0);
  written_ += bytes;
  check(writer != nullptr ? writer->write(file_.get(), std::move(held_), bytes, offset)
                          : pwrite_all(file_.get(), held_.get(), bytes, offset));
}

void SpillFile::check(int error) const {
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

void SpillFile::read(std::uint64_t offset, std::span<std::byte> bytes) const {
  const ReadResult got = pread_all(file_.get(), bytes.data(), bytes.size(), offset);
  if (got.bytes == bytes.size()) return;
  offset += got.bytes;
  const std::string why = got.error != 0 ? system_message(got.error) : "it ends there";
  if (kept()) report_damage(offset, why);
  throw Error(
      ExitCode::budget,
      fmt::format("the temporary file in '{}' cannot be read back at byte {}: {}; choose another with --tmp-dir",
                  directory_, offset, why));
}

void SpillFile::read_through(std::size_t piece, const std::function<void(std::span<const std::byte>)>& take) const {
  std::vector<std::byte> buffer(piece);
  for (std::uint64_t at = begin_; at < written_;) {
    const auto bytes = std::span(buffer).first(static_cast<std::size_t>(std::min<std::uint64_t>(piece, written_ - at)));
    read(at, bytes);
    take(bytes);
    at += bytes.size();
  }
}

}  // namespace lamina
