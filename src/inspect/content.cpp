#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include <array>
#include <cerrno>
#include <memory>
#include <string>
#include <string_view>

#include "base/descriptor.h"
#include "lamina/error.h"
#include "lamina/file_ending.h"
#include "lamina/info.h"

namespace lamina {
namespace {

constexpr std::size_t kLongestHeader = 1 << 16;  // a PLY with more before end_header is taken for points

[[noreturn]] void no_standard_input(int error) {
  throw Error(ExitCode::unreadable, "standard input: cannot be read: " + system_message(error));
}

/// A piece of the pipe; nothing at its end.
std::size_t receive(char* data, std::size_t bytes) {
  for (;;) {
    const ssize_t got = ::read(STDIN_FILENO, data, bytes);
    if (got >= 0) return static_cast<std::size_t>(got);
    if (errno != EINTR) no_standard_input(errno);
  }
}

void spool_standard_input(const std::string& tmp_dir) {
  struct stat status {};
  if (::fstat(STDIN_FILENO, &status) != 0) no_standard_input(errno);
  if (S_ISREG(status.st_mode) && ::lseek(STDIN_FILENO, 0, SEEK_CUR) == 0) return;
  if (::isatty(STDIN_FILENO) == 1)
    throw Error(ExitCode::usage, "standard input is a terminal; name an input file or pipe one in");
  const std::string folder = tmp_dir.empty() ? system_tmp_dir() : tmp_dir;
  const Descriptor file = open_unlinked(folder);
  constexpr std::size_t kPiece = std::size_t{256} << 10;
  const auto buffer = std::make_unique_for_overwrite<char[]>(kPiece);
  while (const std::size_t got = receive(buffer.get(), kPiece)) {
    if (const int error = write_all(file.get(), buffer.get(), got); error != 0) {
      throw Error(ExitCode::budget, fmt::format("{}: no room to keep standard input: {}; choose another folder for "
                                                "temporary files",
                                                folder, system_message(error)));
    }
  }
  if (::lseek(file.get(), 0, SEEK_SET) != 0 || ::dup2(file.get(), STDIN_FILENO) < 0) no_standard_input(errno);
}

/// The first bytes, unpacked where the file is compressed.
std::string beginning(const std::string& path) {
  const std::string opened = path == "-" ? "/dev/stdin" : path;
  const std::unique_ptr<gzFile_s, int (*)(gzFile)> file(gzopen(opened.c_str(), "rb"), gzclose_r);
  if (file == nullptr)
    throw Error(ExitCode::unreadable, fmt::format("{}: cannot be opened: {}", path, system_message(errno)));
  std::string bytes(kLongestHeader, '\0');
  const int got = gzread(file.get(), bytes.data(), static_cast<unsigned>(bytes.size()));
  bytes.resize(got > 0 ? static_cast<std::size_t>(got) : 0);
  return bytes;
}

bool names_faces(std::string_view header) {
  while (!header.empty()) {
    const std::size_t end = header.find_first_of("\r\n");
    const std::string_view line = header.substr(0, end);
    if (line.starts_with("end_header")) return false;
    if (line.starts_with("element tristrips ")) return true;
    if (line.starts_with("element face ") && line.find_first_of("123456789") != std::string_view::npos) return true;
    if (end == std::string_view::npos) return false;
    header.remove_prefix(end + 1);
  }
  return false;
}

/// Vertices come first: the whole file has to be looked at when there are no faces.
bool obj_names_faces(const std::string& path) {
  const std::unique_ptr<gzFile_s, int (*)(gzFile)> file(gzopen(path.c_str(), "rb"), gzclose_r);
  if (file == nullptr) return true;  // the mesh's reader will say why
  gzbuffer(file.get(), 1U << 18);
  std::array<char, 4096> line{};
  bool line_start = true;
  while (gzgets(file.get(), line.data(), static_cast<int>(line.size())) != nullptr) {
    const std::string_view text(line.data());
    if (line_start && (text.starts_with("f ") || text.starts_with("f\t"))) return true;
    line_start = !text.empty() && text.back() == '\n';
  }
  return false;
}

}  // namespace

FileContent content_of(const std::string& path, const std::string& tmp_dir) {
  if (path == "-") spool_standard_input(tmp_dir);
  const std::string start = beginning(path);
  const std::string format = packed_ending(path);
  constexpr std::string_view kVdbMagic(" BDV\0\0\0\0", 8);
  if (std::string_view(start).starts_with(kVdbMagic)) return FileContent::volume;
  if (start.starts_with("ply\n") || start.starts_with("ply\r"))
    return names_faces(start) ? FileContent::mesh : FileContent::points;
  if (format == ".vdb") return FileContent::volume;
  if (start.starts_with("glTF") || format == ".glb") return FileContent::mesh;
  const bool mesh = format == ".off" || format == ".stl" || (format == ".obj" && obj_names_faces(path));
  return mesh ? FileContent::mesh : FileContent::points;
}

}  // namespace lamina
