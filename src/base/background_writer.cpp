#include "base/background_writer.h"

#include <utility>

#include "base/descriptor.h"

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
  changed_.notify_all();
  return error_;
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

}  // namespace lamina
