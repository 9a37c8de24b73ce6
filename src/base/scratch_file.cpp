#include "base/scratch_file.h"

#include <fmt/format.h>

#include <cerrno>

#include "lamina/error.h"

namespace lamina {

void ScratchFile::write(std::span<const std::byte> bytes) {
  check(write_all(file_.get(), bytes.data(), bytes.size()));
}

void ScratchFile::read(std::uint64_t offset, std::span<std::byte> bytes) const {
  const ReadResult got = pread_all(file_.get(), bytes.data(), bytes.size(), offset);
  check(got.error != 0 || got.bytes == bytes.size() ? got.error : EIO);
}

void ScratchFile::check(int error) const {
  if (error == 0) return;
  throw Error(ExitCode::budget, fmt::format("the temporary file in '{}' cannot be used: {}; free space there or "
                                            "choose another with --tmp-dir",
                                            directory_, system_message(error)));
}

}  // namespace lamina
