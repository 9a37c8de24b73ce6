// A point file opened for reading at any offset, whatever it came from.
#pragma once
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "files/descriptor.h"

namespace lamina {

struct InputFile {
  Descriptor file;
  std::uint64_t bytes = 0;
  std::string name;  ///< for messages

  /// Fills `data`; fewer bytes only at the end of the file. Throws Error(unreadable) when the system cannot read.
  std::size_t read(std::uint64_t offset, void* data, std::size_t size) const;
};

/// Opens a file, or "-" for standard input; what is not a regular file read from its beginning (a pipe, a device) is
/// spooled to an unlinked file in `tmp_dir`.
/// What does not begin like a PLY is refused before it is spooled.
InputFile open_input(const std::string& path, const std::string& tmp_dir);

/// A file name or a word of a file made fit for a one-line message: unprintable characters replaced, long ones cut.
std::string quoted(std::string_view word);

}  // namespace lamina
