// A point file opened for reading at any offset, whatever it came from.
#pragma once
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "base/descriptor.h"

namespace lamina {

struct InputFile {
  Descriptor file;
  std::uint64_t bytes = 0;
  std::string name;  ///< for messages
  /// When a file of the user's was last written to, nanoseconds; nothing for those of our own.
  std::optional<std::int64_t> written{};

  /// Fills `data`; fewer bytes only at the end of the file. Throws Error(unreadable) when the system cannot read, or
  /// when another program has written to the file since it was opened.
  std::size_t read(std::uint64_t offset, void* data, std::size_t size) const;
};

/// Holds nothing when the file cannot be opened; errno says why.
Descriptor open_to_read(const std::string& path);

/// The beginning of a file, enough to tell its format.
inline constexpr std::size_t kSniffBytes = 64 << 10;

/// Opens a file, or "-" for standard input; what is not a regular file read from its beginning (a pipe, a device) is
/// spooled to an unlinked file in `tmp_dir`, and gzip is unpacked to one.
/// What is no point file known here is refused before it is spooled.
InputFile open_input(const std::string& path, const std::string& tmp_dir);

/// Bytes written to an unnamed temporary file, which then is the input.
class Spool {
 public:
  /// `name` for messages. Throws Error(budget) when there is no folder to write to.
  Spool(std::string name, const std::string& tmp_dir);
  /// Throws Error(budget) when the disk is full.
  void write(const void* data, std::size_t bytes);
  [[nodiscard]] std::uint64_t bytes() const { return file_.bytes; }
  InputFile finish() { return std::move(file_); }

 private:
  std::string directory_;
  InputFile file_;
};

/// A file name or a word of a file made fit for a one-line message: unprintable characters replaced, long ones cut.
std::string quoted_word(std::string_view word);

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

// Compressed data, unpacked as a whole before they are read: readers want any place of the file.

bool is_gzip(std::string_view start);

/// Unpacks gzip to an unnamed file in `tmp_dir`; several members behind each other are one file.
/// Throws Error(unreadable) naming the byte where it is damaged or cut short, and for contents that are no point file;
/// Error(budget) when there is no room.
InputFile unpack_gzip(const InputFile& packed, const std::string& tmp_dir);

/// LZF (Marc Lehmann's format), as PCD's compressed data use it: unpacks `packed` bytes from `offset` on into `out`,
/// which must come to exactly `unpacked` bytes, through a small window. Throws Error(unreadable) naming the byte where
/// the data are damaged.
void unpack_lzf(const InputFile& file, std::uint64_t offset, std::uint64_t packed, std::uint64_t unpacked, Spool& out);

}  // namespace lamina
