// A binary file read forward in small pieces.
#pragma once
#include <cstddef>
#include <cstdint>
#include <memory>

#include "points/input_file.h"

namespace lamina {

/// Reads small pieces forward through a buffer.
class ByteCursor {
 public:
  ByteCursor(const InputFile& file, std::uint64_t offset) : file_(file), offset_(offset) {}
  [[nodiscard]] std::uint64_t offset() const { return offset_; }
  [[nodiscard]] std::uint64_t left() const { return file_.bytes - offset_; }

  /// The next `size` bytes (at most 8), null when the file ends before.
  const std::byte* take(std::size_t size) {
    if (size > left()) return nullptr;
    if (offset_ < begin_ || offset_ + size > end_) {
      begin_ = offset_;
      end_ = begin_ + file_.read(begin_, buffer_.get(), kBytes);
      if (offset_ + size > end_) return nullptr;
    }
    const std::byte* p = buffer_.get() + (offset_ - begin_);
    offset_ += size;
    return p;
  }

  bool skip(std::uint64_t size) {
    if (size > left()) return false;
    offset_ += size;
    return true;
  }

 private:
  static constexpr std::size_t kBytes = 128 << 10;
  const InputFile& file_;
  std::unique_ptr<std::byte[]> buffer_ = std::make_unique_for_overwrite<std::byte[]>(kBytes);
  std::uint64_t offset_, begin_ = 0, end_ = 0;
};

}  // namespace lamina
