// A slow disk for measuring: preloaded into a program, it lets reads and writes of files pass at SLOW_DISK_MB megabytes
// per second in all, whatever the page cache could do. Time passes asleep, as it does waiting for a device.
#include <dlfcn.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <mutex>
#include <thread>

namespace {

using Clock = std::chrono::steady_clock;

/// Makes transfers queue up, one behind the other, as on one device.
class Disk {
 public:
  void transfer(std::size_t bytes) {
    Clock::time_point done;
    {
      const std::lock_guard lock(mutex_);
      const auto length = std::chrono::duration<double>(static_cast<double>(bytes) / rate_);
      free_ = std::max(free_, Clock::now()) + std::chrono::duration_cast<Clock::duration>(length);
      done = free_;
    }
    std::this_thread::sleep_until(done);
  }

 private:
  static double rate() {
    const char* words = std::getenv("SLOW_DISK_MB");
    return (words == nullptr ? 100.0 : std::atof(words)) * 1e6;
  }
  double rate_ = rate();
  std::mutex mutex_;
  Clock::time_point free_;
};

void pass(int file, ssize_t bytes) {
  static Disk disk;
  struct stat about {};
  if (bytes > 0 && fstat(file, &about) == 0 && S_ISREG(about.st_mode)) disk.transfer(static_cast<std::size_t>(bytes));
}

template <class Function>
Function next(const char* name) {
  return reinterpret_cast<Function>(dlsym(RTLD_NEXT, name));
}

}  // namespace

extern "C" {

ssize_t write(int file, const void* from, size_t bytes) {
  static const auto real = next<ssize_t (*)(int, const void*, size_t)>("write");
  const ssize_t done = real(file, from, bytes);
  pass(file, done);
  return done;
}
ssize_t pwrite64(int file, const void* from, size_t bytes, off64_t at) {
  static const auto real = next<ssize_t (*)(int, const void*, size_t, off64_t)>("pwrite64");
  const ssize_t done = real(file, from, bytes, at);
  pass(file, done);
  return done;
}
ssize_t pwrite(int file, const void* from, size_t bytes, off_t at) {
  return pwrite64(file, from, bytes, at);
}
ssize_t read(int file, void* to, size_t bytes) {
  static const auto real = next<ssize_t (*)(int, void*, size_t)>("read");
  const ssize_t done = real(file, to, bytes);
  pass(file, done);
  return done;
}
ssize_t pread64(int file, void* to, size_t bytes, off64_t at) {
  static const auto real = next<ssize_t (*)(int, void*, size_t, off64_t)>("pread64");
  const ssize_t done = real(file, to, bytes, at);
  pass(file, done);
  return done;
}
ssize_t pread(int file, void* to, size_t bytes, off_t at) {
  return pread64(file, to, bytes, at);
}
ssize_t copy_file_range(int from, off64_t* from_at, int to, off64_t* to_at, size_t bytes, unsigned flags) {
  static const auto real = next<ssize_t (*)(int, off64_t*, int, off64_t*, size_t, unsigned)>("copy_file_range");
  const ssize_t done = real(from, from_at, to, to_at, bytes, flags);
  pass(to, 2 * done);
  return done;
}

}  // extern "C"
