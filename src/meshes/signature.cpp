// The comment by which our own files are known again.
#include <fcntl.h>
#include <fmt/format.h>

#include <array>
#include <cerrno>
#include <string_view>

#include "base/descriptor.h"
#include "lamina/error.h"
#include "meshes/mesh_sink.h"

namespace lamina {
namespace {

constexpr std::string_view kMadeBy = "made by lamina ";

}  // namespace

std::string sink_signature() {
  return std::string(kMadeBy) + LAMINA_VERSION;
}

std::optional<std::string> read_sink_signature(const std::string& path) {
  const Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  std::array<char, 512> start{};  // it is the header's first comment
  ReadResult got{0, errno};
  if (file) got = pread_all(file.get(), start.data(), start.size(), 0);
  if (got.error != 0) {
    throw Error(ExitCode::unreadable, fmt::format("{}: cannot be read: {}", path, system_message(got.error)));
  }
  const std::string_view text(start.data(), got.bytes);
  const std::string line = "\ncomment " + std::string(kMadeBy);
  const std::size_t at = text.find(line);
  if (!text.starts_with("ply\n") || at == std::string_view::npos) return std::nullopt;
  const std::size_t begin = at + line.size();
  const std::size_t end = text.find('\n', begin);
  if (end == std::string_view::npos) return std::nullopt;
  return std::string(text.substr(begin, end - begin));
}

}  // namespace lamina
