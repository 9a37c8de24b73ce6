#include "points/input_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <cerrno>
#include <memory>

#include "lamina/error.h"
#include "points/formats.h"

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

namespace {

constexpr std::size_t kUnpackedAtOnce = 256 << 10;
constexpr int kGzipOnly = 16 + MAX_WBITS;

class Inflater {
 public:
  explicit Inflater(const std::string& name) {
    if (inflateInit2(&stream, kGzipOnly) != Z_OK) {
      throw Error(ExitCode::budget, fmt::format("{}: no memory to unpack it", name));
    }
  }
  ~Inflater() { inflateEnd(&stream); }
  Inflater(const Inflater&) = delete;
  Inflater& operator=(const Inflater&) = delete;

  z_stream stream{};
};

constexpr std::size_t kInput = 128 << 10;
constexpr std::size_t kHistory = 8 << 10;  ///< how far back a copy reaches
constexpr std::size_t kOutput = 256 << 10;

class Unpacker {
 public:
  Unpacker(const InputFile& file, std::uint64_t offset, std::uint64_t packed, std::uint64_t unpacked, Spool& out)
      : file_(file), offset_(offset), end_(offset + packed), left_(unpacked), out_(out) {}

  void run() {
    while (next_ != filled_ || offset_ != end_) {
      const unsigned control = byte();
      control < 32 ? literals(control + 1) : copy(control);
    }
    flush();
    if (left_ != 0) damaged("end too early");
  }

 private:
  [[noreturn]] void damaged(const char* what) const {
    throw Error(ExitCode::unreadable,
                fmt::format("{}: the compressed data {} at byte {}: the file is damaged; write it again as binary",
                            file_.name, what, offset_ - (filled_ - next_)));
  }

  unsigned byte() {
    if (next_ == filled_) {
      const auto wanted = static_cast<std::size_t>(std::min<std::uint64_t>(kInput, end_ - offset_));
      next_ = 0;
      filled_ = wanted == 0 ? 0 : file_.read(offset_, input_.get(), wanted);
      offset_ += filled_;
      if (filled_ == 0) damaged("are cut short");
    }
    return input_[next_++];
  }

  void put(unsigned char value) {
    if (left_ == 0) damaged("hold more than the header says");
    if (at_ == kOutput) {
      flush();
      std::copy(output_.get() + kOutput - kHistory, output_.get() + kOutput, output_.get());
      at_ = written_ = kHistory;
    }
    output_[at_++] = value;
    --left_;
  }

  void literals(unsigned count) {
    for (; count > 0; --count) put(static_cast<unsigned char>(byte()));
  }

  void copy(unsigned control) {
    constexpr unsigned kLong = 7;
    unsigned length = control >> 5U;
    if (length == kLong) length += byte();
    const std::size_t back = ((control & 31U) << 8U) + byte() + 1;
    if (back > at_) damaged("point before their beginning");
    for (length += 2; length > 0; --length) put(output_[at_ - back]);
  }

  void flush() {
    out_.write(output_.get() + written_, at_ - written_);
    written_ = at_;
  }

  const InputFile& file_;
  std::uint64_t offset_, end_;
  std::uint64_t left_;
  Spool& out_;
  std::unique_ptr<unsigned char[]> input_ = std::make_unique_for_overwrite<unsigned char[]>(kInput);
  std::size_t next_ = 0, filled_ = 0;
  std::unique_ptr<unsigned char[]> output_ = std::make_unique_for_overwrite<unsigned char[]>(kOutput);
  std::size_t at_ = 0, written_ = 0;
};

}  // namespace

bool is_gzip(std::string_view start) {
  return start.starts_with("\x1f\x8b");
}

InputFile unpack_gzip(const InputFile& packed, const std::string& tmp_dir) {
  const auto in = std::make_unique_for_overwrite<Bytef[]>(kUnpackedAtOnce);
  const auto out = std::make_unique_for_overwrite<Bytef[]>(kUnpackedAtOnce);
  Inflater inflater(packed.name);
  z_stream& stream = inflater.stream;
  std::uint64_t offset = 0;
  bool member_ended = false;
  Spool spool(packed.name, tmp_dir);
  const auto damaged = [&](std::string_view what) {
    throw Error(ExitCode::unreadable,
                fmt::format("{}: the gzip data are {} at byte {}; copy or compress the file again", packed.name, what,
                            offset - stream.avail_in));
  };
  for (;;) {
    if (stream.avail_in == 0) {
      stream.next_in = in.get();
      stream.avail_in = static_cast<uInt>(packed.read(offset, in.get(), kUnpackedAtOnce));
      offset += stream.avail_in;
      if (stream.avail_in == 0) {
        if (!member_ended) damaged("cut short");
        break;
      }
    }
    if (member_ended) {
      if (*stream.next_in == 0) {  // padding, as tapes and some tools leave it
        --stream.avail_in;
        ++stream.next_in;
        continue;
      }
      inflateReset(&stream);
      member_ended = false;
    }
    stream.next_out = out.get();
    stream.avail_out = kUnpackedAtOnce;
    const int status = inflate(&stream, Z_NO_FLUSH);
    if (status != Z_OK && status != Z_STREAM_END) damaged("damaged");
    const std::size_t n = kUnpackedAtOnce - stream.avail_out;
    if (n > 0 && spool.bytes() == 0) {
      detect_format({reinterpret_cast<const char*>(out.get()), std::min(n, kSniffBytes)}, packed.name);
    }
    if (n > 0) spool.write(out.get(), n);
    member_ended = status == Z_STREAM_END;
  }
  return spool.finish();
}

void unpack_lzf(const InputFile& file, std::uint64_t offset, std::uint64_t packed, std::uint64_t unpacked, Spool& out) {
  Unpacker(file, offset, packed, unpacked, out).run();
}

}  // namespace lamina
