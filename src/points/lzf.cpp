#include "points/lzf.h"

#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "lamina/error.h"

namespace lamina {
namespace {

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

void unpack_lzf(const InputFile& file, std::uint64_t offset, std::uint64_t packed, std::uint64_t unpacked, Spool& out) {
  Unpacker(file, offset, packed, unpacked, out).run();
}

}  // namespace lamina
