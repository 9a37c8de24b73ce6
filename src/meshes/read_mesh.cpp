#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <limits>
#include <string>
#include <string_view>

#include "base/descriptor.h"
#include "base/number.h"
#include "lamina/error.h"
#include "lamina/file_ending.h"
#include "lamina/mesh.h"
#include "meshes/formats.h"
#include "points/formats.h"
#include "points/text_rows.h"

namespace lamina::meshes {

FileBuffer::FileBuffer(const std::string& path) : path_(path), buffer_(kReadBytes) {
  std::error_code ec;
  if (std::filesystem::is_directory(path, ec))
    throw Error(ExitCode::unreadable, fmt::format("{}: is a directory, not a mesh file", path));
  const std::string opened = path == "-" ? "/dev/stdin" : path;
  file_ = gzopen(opened.c_str(), "rb");
  if (file_ == nullptr)
    throw Error(ExitCode::unreadable, fmt::format("{}: cannot be opened: {}", path, std::strerror(errno)));
  gzbuffer(file_, kReadBytes);
  compressed_ = gzdirect(file_) == 0;
  const auto size = std::filesystem::file_size(opened, ec);
  disk_bytes_ = ec ? 0 : size;
}

FileBuffer::~FileBuffer() {
  gzclose_r(file_);
}

void FileBuffer::require_sound() const {
  if (!failure_.empty())
    throw Error(ExitCode::unreadable,
                fmt::format("{}: cannot be read to its end ({}); copy or make it again", path_, failure_));
}

FileBuffer::int_type FileBuffer::underflow() {
  if (gptr() < egptr()) return traits_type::to_int_type(*gptr());
  const int got = gzread(file_, buffer_.data(), kReadBytes);
  int code = Z_OK;
  const char* message = gzerror(file_, &code);
  if (got < 0 || code == Z_BUF_ERROR || code == Z_DATA_ERROR)
    failure_ = code == Z_ERRNO ? std::strerror(errno) : message;
  if (got <= 0) return traits_type::eof();
  setg(buffer_.data(), buffer_.data(), buffer_.data() + got);
  return traits_type::to_int_type(*gptr());
}

FileBuffer::pos_type FileBuffer::seekoff(off_type offset, std::ios_base::seekdir way, std::ios_base::openmode which) {
  const off_type here = static_cast<off_type>(gztell(file_)) - (egptr() - gptr());
  if (way == std::ios_base::end) return pos_type(off_type(-1));
  const off_type target = way == std::ios_base::cur ? here + offset : offset;
  return target == here ? pos_type(here) : seekpos(pos_type(target), which);
}

FileBuffer::pos_type FileBuffer::seekpos(pos_type position, std::ios_base::openmode) {
  setg(nullptr, nullptr, nullptr);
  gzclearerr(file_);
  const auto at = gzseek(file_, static_cast<z_off_t>(off_type(position)), SEEK_SET);
  return at < 0 ? pos_type(off_type(-1)) : pos_type(off_type(at));
}

}  // namespace lamina::meshes

namespace lamina {
namespace {

TriangleMesh read_by_format(meshes::FileBuffer& file, const std::string& path) {
  std::istream in(&file);
  std::string magic(4, '\0');
  in.read(magic.data(), 4);
  magic.resize(static_cast<std::size_t>(in.gcount()));
  file.require_sound();
  if (magic.empty()) throw Error(ExitCode::unreadable, fmt::format("{}: is empty", path));
  // OpenMesh's readers would take the first line for something else.
  if (magic.starts_with(kByteOrderMark)) {
    throw Error(ExitCode::unreadable,
                fmt::format("{}: begins with a byte order mark; save it without: tail -c +4 FILE > OTHER", path));
  }
  in.clear();
  in.seekg(0);
  const std::string format = packed_ending(path);
  if (magic == "ply\n" || magic == "ply\r" || format == ".ply") return meshes::read_ply(file, path);
  if (magic == "glTF" || format == ".glb") return meshes::read_glb(file, path);
  if (format == ".obj") return meshes::read_with_openmesh(file, path, meshes::TextFormat::obj);
  if (format == ".off") return meshes::read_off(file, path);
  if (format == ".stl") return meshes::read_with_openmesh(file, path, meshes::TextFormat::stl);
  if (format == ".vdb") {
    throw Error(
        ExitCode::unreadable,
        fmt::format("{0}: is a volume, where a mesh is wanted; 'lamina convert {0} -o mesh.ply' meshes its level "
                    "set",
                    path));
  }
  if (has_point_ending(path)) {
    throw Error(
        ExitCode::unreadable,
        fmt::format("{0}: holds points, where a mesh is wanted; 'lamina surface {0} -o mesh.ply' makes one of them",
                    path));
  }
  throw Error(ExitCode::unreadable,
              fmt::format("{}: unknown mesh format \"{}\"; known are .ply, .obj, .off, .stl, .glb, each also as .gz",
                          path, format));
}

bool is_finite(const std::array<double, 3>& p) {
  return std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]);
}

}  // namespace

TriangleMesh read_mesh(const std::string& path, NonFinite non_finite) {
  meshes::FileBuffer file(path);
  TriangleMesh mesh = read_by_format(file, path);
  if (mesh.positions.empty()) throw Error(ExitCode::unreadable, fmt::format("{}: has no vertices", path));
  if (non_finite == NonFinite::keep) return mesh;
  for (std::size_t i = 0; i < mesh.positions.size(); ++i)
    for (const double c : mesh.positions[i])
      if (!std::isfinite(c))
        throw Error(
            ExitCode::unreadable,
            fmt::format(
                "{0}: vertex {1} has a coordinate that is not finite; 'lamina convert {0} -o mesh.ply' leaves it "
                "out",
                path, i));
  return mesh;
}

std::size_t drop_non_finite(TriangleMesh& mesh) {
  constexpr std::uint32_t kGone = std::numeric_limits<std::uint32_t>::max();
  std::vector<std::uint32_t> place(mesh.positions.size(), kGone);
  std::uint32_t kept = 0;
  for (std::size_t v = 0; v < place.size(); ++v) {
    if (!is_finite(mesh.positions[v])) continue;
    place[v] = kept;
    mesh.positions[kept] = mesh.positions[v];
    if (!mesh.normals.empty()) mesh.normals[kept] = mesh.normals[v];
    for (auto& values : mesh.attributes) values[kept] = values[v];
    ++kept;
  }
  const std::size_t dropped = place.size() - kept;
  if (dropped == 0) return 0;
  mesh.positions.resize(kept);
  if (!mesh.normals.empty()) mesh.normals.resize(kept);
  for (auto& values : mesh.attributes) values.resize(kept);
  std::erase_if(mesh.triangles, [&](auto& triangle) {
    for (std::uint32_t& v : triangle) v = place[v];
    return triangle[0] == kGone || triangle[1] == kGone || triangle[2] == kGone;
  });
  return dropped;
}

}  // namespace lamina

namespace lamina::meshes {

void settle_colour_range(TriangleMesh& mesh) {
  const bool bytes = std::any_of(mesh.attributes.begin(), mesh.attributes.end(), [](const auto& channel) {
    return std::any_of(channel.begin(), channel.end(), [](float c) { return c > 1; });
  });
  if (bytes)
    for (auto& a : mesh.layout) a.type = ScalarType::uint8;
}

namespace {

/// Lines that hold something: blanks trimmed, comments (#) cut off, empty ones passed over.
class OffLines {
 public:
  explicit OffLines(std::istream& in) : in_(in) {}
  /// Empty at the end of the file; valid until the next call.
  std::string_view next() {
    while (std::getline(in_, line_)) {
      ++number_;
      line_.resize(std::min(line_.find('#'), line_.size()));
      if (const auto text = trimmed(line_); !text.empty()) return text;
    }
    return {};
  }
  [[nodiscard]] std::uint64_t number() const { return number_; }

 private:
  std::istream& in_;
  std::string line_;
  std::uint64_t number_ = 0;
};

class OffReader {
 public:
  OffReader(std::istream& in, const std::string& path) : lines_(in), path_(path) {}

  TriangleMesh read() {
    header();
    // The counts are not to be believed before the lines have been seen.
    for (std::uint64_t v = 0; v < vertices_; ++v) vertex(next_line("vertex", v, vertices_));
    for (std::uint64_t f = 0; f < faces_; ++f) face(next_line("face", f, faces_));
    if (!lines_.next().empty()) fail("more lines than the header's counts promise");
    settle_colours();
    return std::move(mesh_);
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw Error(ExitCode::unreadable, fmt::format("{}: line {}: {}", path_, lines_.number(), what));
  }

  std::string_view next_line(const char* what, std::uint64_t i, std::uint64_t count) {
    const auto text = lines_.next();
    if (text.empty())
      fail(fmt::format("ends in {} {} of the {} its header promises: the file is cut short", what, i, count));
    return text;
  }

  std::uint64_t count(std::string_view& text) const {
    const auto value = take_decimal(text);
    if (!value || !(*value >= 0) || *value >= 4294967295.0 || *value != std::floor(*value))
      fail("an OFF header needs the counts of vertices and faces");
    return static_cast<std::uint64_t>(*value);
  }

  void header() {
    std::string_view text = lines_.next();
    const auto magic = text.substr(0, text.find_first_of(" \t"));
    if (!magic.ends_with("OFF")) fail("not an OFF file (no \"OFF\" at its start)");
    if (text.find("BINARY") != std::string_view::npos) fail("binary OFF is not supported: convert to PLY");
    const auto kind = magic.substr(0, magic.size() - 3);
    if (kind.find_first_not_of("CN") != std::string_view::npos)
      fail(fmt::format("{} is not supported, only vertices of three coordinates with colours (C) and normals (N)",
                       magic));
    normals_ = kind.find('N') != std::string_view::npos;
    text = trimmed(text.substr(magic.size()));
    if (text.empty()) text = lines_.next();
    vertices_ = count(text);
    faces_ = count(text);
  }

  std::array<double, 3> triple(std::string_view& text, const char* what) const {
    std::array<double, 3> p{};
    for (double& c : p) {
      const auto value = take_decimal(text);
      if (!value) fail(fmt::format("{} needs three numbers", what));
      c = *value;
    }
    return p;
  }

  void vertex(std::string_view text) {
    mesh_.positions.push_back(triple(text, "a vertex"));
    if (normals_) {
      const auto n = triple(text, "a normal");
      mesh_.normals.push_back({static_cast<float>(n[0]), static_cast<float>(n[1]), static_cast<float>(n[2])});
    }
    std::size_t channel = 0;
    for (auto c = take_decimal(text); c && channel < 4; c = take_decimal(text), ++channel) {
      if (colours_.size() == channel) colours_.emplace_back(mesh_.positions.size() - 1);
      colours_[channel].push_back(static_cast<float>(*c));
    }
    for (auto& c : colours_) c.resize(mesh_.positions.size());
  }

  void face(std::string_view text) {
    const auto corners = take_decimal(text);
    if (!corners || !(*corners >= 3)) fail("a polygon needs three corners");
    const std::uint32_t first = index(text);
    std::uint32_t last = index(text);
    for (double k = 2; k < *corners; ++k) {
      const std::uint32_t next = index(text);
      mesh_.triangles.push_back({first, last, next});
      last = next;
    }
  }

  std::uint32_t index(std::string_view& text) const {
    const auto v = take_decimal(text);
    if (!v || !(*v >= 0) || *v != std::floor(*v)) fail("a face needs its number of corners and as many vertex numbers");
    if (*v >= static_cast<double>(vertices_))
      fail(fmt::format("the face names vertex {} but there are {}", *v, vertices_));
    return static_cast<std::uint32_t>(*v);
  }

  void settle_colours() {
    if (colours_.size() < 3) return;
    static constexpr const char* kNames[] = {"red", "green", "blue", "alpha"};
    for (std::size_t k = 0; k < colours_.size(); ++k) mesh_.layout.push_back({kNames[k], ScalarType::float32});
    mesh_.attributes = std::move(colours_);
    settle_colour_range(mesh_);
  }

  OffLines lines_;
  const std::string& path_;
  bool normals_ = false;
  std::uint64_t vertices_ = 0, faces_ = 0;
  std::vector<std::vector<float>> colours_;
  TriangleMesh mesh_;
};

}  // namespace

TriangleMesh read_off(FileBuffer& file, const std::string& path) {
  std::istream in(&file);
  try {
    TriangleMesh mesh = OffReader(in, path).read();
    file.require_sound();
    return mesh;
  } catch (const Error&) {
    file.require_sound();  // what looked like an early end may be a damaged archive
    throw;
  }
}

}  // namespace lamina::meshes
