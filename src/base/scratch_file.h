// A temporary file without a name, written from its begin to its end and read back in any order.
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "base/descriptor.h"

namespace lamina {

class ScratchFile {
 public:
  /// Throws Error(budget) naming the directory when no file can be made in it.
  explicit ScratchFile(const std::string& directory) : directory_(directory), file_(open_unlinked(directory)) {}

  /// Adds bytes at the end. Throws Error(budget) naming the directory when they cannot be written.
  void write(std::span<const std::byte> bytes);
  /// Fills `bytes` from `offset`. Throws Error(budget) naming the directory when they cannot be read.
  void read(std::uint64_t offset, std::span<std::byte> bytes) const;

 private:
  void check(int error) const;

  std::string directory_;
  Descriptor file_;
};

}  // namespace lamina
