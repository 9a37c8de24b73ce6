// A temporary file without a name: gone when it is closed, however the program ends.
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace lamina {

class TempFile {
 public:
  /// Throws Error(budget) naming the directory when no file can be made in it.
  explicit TempFile(std::string directory);
  ~TempFile();
  TempFile(TempFile&& other) noexcept;
  TempFile& operator=(TempFile&& other) noexcept;

  /// Adds bytes at the end and returns their offset. They are written in large pieces at whole pages: small writes cost
  /// the kernel twice the work. Throws Error(budget) naming the directory and the bytes written so far.
  std::uint64_t append(std::span<const std::byte> bytes);
  /// Writes what append() still holds; before that it cannot be read. Throws as append() does.
  void flush();
  /// Fills `bytes` from `offset`; safe from several threads. Throws Error(budget) when they cannot be read.
  void read(std::uint64_t offset, std::span<std::byte> bytes) const;
  /// Gives the disk space back; nothing can be appended or read any more.
  void discard();
  [[nodiscard]] std::uint64_t size() const { return written_ + held_.size(); }
  [[nodiscard]] const std::string& directory() const { return directory_; }

 private:
  std::string directory_;
  int descriptor_ = -1;
  std::uint64_t written_ = 0;
  std::vector<std::byte> held_;
};

}  // namespace lamina
