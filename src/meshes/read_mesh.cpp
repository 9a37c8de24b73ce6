#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>

#include "base/descriptor.h"
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

}  // namespace lamina::meshes
