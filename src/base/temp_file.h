// A file of a store: temporary and without a name, gone when it is closed, however the program ends; or named and kept.
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "base/background_writer.h"
#include "base/descriptor.h"

namespace lamina {

class TempFile {
 public:
  static constexpr std::size_t kBufferBytes = 1U << 17;

  /// Throws Error(budget) naming the directory when no file can be made in it.
  explicit TempFile(std::string directory);
  /// A file that stays, made anew. Throws as above.
  TempFile(std::string directory, std::string name);
  /// One that stayed, for reading. Throws Error(unreadable) naming it where it is not there.
  static TempFile open(std::string directory, std::string name);

  /// Adds bytes at the end and returns their offset. They are written in large pieces at whole pages: small writes cost
  /// the kernel twice the work, by `writer` (buffers of kBufferBytes) and later. Throws Error(budget) naming the
  /// directory and the bytes written so far when a write has failed.
  std::uint64_t append(std::span<const std::byte> bytes, BackgroundWriter& writer);
  /// Hands over what append() still holds; before that, and before the writer is drained, it cannot be read. Throws as
  /// append() does.
  void flush(BackgroundWriter& writer);
  /// Throws what a failed write is worth. `error`: of the writer, 0 for none.
  void check(int error) const;
  /// Fills `bytes` from `offset`; safe from several threads. Throws Error(budget) when they cannot be read.
  void read(std::uint64_t offset, std::span<std::byte> bytes) const;
  /// Starts reading into the system's cache.
  void will_read(std::uint64_t offset, std::uint64_t bytes) const;
  /// Gives the disk space back; nothing can be appended or read any more.
  void discard();
  [[nodiscard]] std::uint64_t size() const { return written_ + held_bytes_; }
  /// Throws that bytes at `offset` are not what was written; `what`: they hold.
  [[noreturn]] void report_damage(std::uint64_t offset, const std::string& what) const;
  [[nodiscard]] bool kept() const { return !name_.empty(); }

 private:
  TempFile(std::string directory, std::string name, Descriptor file);

  std::string directory_, name_;  ///< no name: temporary
  Descriptor file_;
  std::uint64_t written_ = 0;
  BackgroundWriter::Buffer held_;
  std::size_t held_bytes_ = 0;
};

}  // namespace lamina
