#include "points/text_file.h"

#include <fmt/format.h>

#include <algorithm>

#include "lamina/error.h"

namespace lamina {

char line_end_of(const InputFile& file) {
  std::string start(static_cast<std::size_t>(std::min<std::uint64_t>(file.bytes, kSniffBytes)), '\0');
  start.resize(file.read(0, start.data(), start.size()));
  return start.find('\n') == std::string::npos && start.find('\r') != std::string::npos ? '\r' : '\n';
}

void report_vanished_rows(const InputFile& file, std::uint64_t line) {
  throw Error(
      ExitCode::unreadable,
      fmt::format("{}: ends at line {}, it was longer when it was opened: is it being written?", file.name, line));
}

}  // namespace lamina
