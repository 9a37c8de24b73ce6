// What does not fit in memory, on disk: written from its beginning to its end and read back from anywhere.
#pragma once
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>

#include "base/background_writer.h"
#include "base/descriptor.h"

namespace lamina {

/// Temporary and without a name, gone when it is closed, however the program ends; or named and kept, as a store's are.
class SpillFile {
 public:
  static constexpr std::size_t kBufferBytes = 1U << 17;

  /// Throws Error(budget) naming the directory when no file can be made in it.
  explicit SpillFile(std::string directory);
  /// A file that stays, made anew. Throws as above.
  SpillFile(std::string directory, std::string name);
  /// One that stayed, for reading. Throws Error(unreadable) naming it where it is not there.
  static SpillFile open(std::string directory, std::string name);

  /// Adds bytes at the end and returns their offset. They are written in large pieces at whole pages: small writes cost
  /// the kernel twice the work. Throws Error(budget) naming the directory and the bytes written so far when a write has
  /// failed.
  std::uint64_t append(std::span<const std::byte> bytes) { return append(bytes, nullptr); }
  /// The same, written later by `writer` (buffers of kBufferBytes).
  std::uint64_t append(std::span<const std::byte> bytes, BackgroundWriter& writer) { return append(bytes, &writer); }
  /// Writes what append() still holds; before that (and before the writer is drained) it cannot be read. Throws as
  /// append() does.
  void flush() { flush(nullptr); }
  void flush(BackgroundWriter& writer) { flush(&writer); }
  /// Throws what a failed write is worth. `error`: of the writer, 0 for none.
  void check(int error) const;

  /// Fills `bytes` from `offset`; safe from several threads. Throws Error(budget) when they cannot be read.
  void read(std::uint64_t offset, std::span<std::byte> bytes) const;
  /// Gives all of it to `take`, in order, `piece` bytes at a time; the last piece may be shorter. Throws as read()
  /// does.
  void read_through(std::size_t piece, const std::function<void(std::span<const std::byte>)>& take) const;
  /// Starts reading into the system's cache.
  void will_read(std::uint64_t offset, std::uint64_t bytes) const;

  /// Gives back the disk space of what lies before `offset`, where the file system can. A flushed file of which nothing
  /// is left is empty again: begin() and size() are 0.
  void discard_before(std::uint64_t offset);
  /// Gives all disk space back; nothing can be appended or read any more.
  void discard();
  [[nodiscard]] std::uint64_t begin() const { return begin_; }  ///< offset of the first byte that was not discarded
  [[nodiscard]] std::uint64_t size() const { return written_ + held_bytes_; }  ///< offset of the next byte

  /// Throws that bytes at `offset` are not what was written; `what`: they hold.
  [[noreturn]] void report_damage(std::uint64_t offset, const std::string& what) const;
  [[nodiscard]] bool kept() const { return !name_.empty(); }

 private:
  SpillFile(std::string directory, std::string name, Descriptor file);
  std::uint64_t append(std::span<const std::byte> bytes, BackgroundWriter* writer);
  void flush(BackgroundWriter* writer);

  std::string directory_, name_;  ///< no name: temporary
  Descriptor file_;
  std::uint64_t begin_ = 0, written_ = 0;
  BackgroundWriter::Buffer held_;
  std::size_t held_bytes_ = 0;
};

}  // namespace lamina
