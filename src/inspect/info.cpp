#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "base/descriptor.h"
#include "edit/rows.h"
#include "lamina/edit.h"
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

namespace {

/// The range of a column, piece by piece.
class RangeOf {
 public:
  RangeOf(std::string name, ScalarType type) : range_{std::move(name), type} {}

  template <class T>
  void add(T value) {
    if (!std::isfinite(value)) {
      ++range_.not_finite;
      return;
    }
    const auto v = static_cast<double>(value);
    if (range_.values++ == 0) range_.low = range_.high = first_ = v;
    range_.low = std::min(range_.low, v);
    range_.high = std::max(range_.high, v);
    sum_ += v - first_;  // about the first value: georeferenced coordinates keep their digits
  }
  template <class T>
  void add_all(const std::vector<T>& values) {
    for (const T value : values) add(value);
  }
  [[nodiscard]] ColumnRange result() const {
    ColumnRange out = range_;
    if (out.values > 0) {
      out.mean = std::clamp(first_ + sum_ / static_cast<double>(out.values), out.low, out.high);
    }
    return out;
  }

 private:
  ColumnRange range_;
  double first_ = 0, sum_ = 0;
};

/// Radii above 0 by half octaves.
class RadiusBins {
 public:
  void add(float radius) {
    if (radius > 0 && std::isfinite(radius)) ++bins_[static_cast<int>(std::floor(2 * std::log2(double{radius})))];
  }
  [[nodiscard]] std::vector<HistogramBin> result() const {
    std::vector<HistogramBin> out;
    if (bins_.empty()) return out;
    for (int b = bins_.begin()->first; b <= bins_.rbegin()->first; ++b) {
      const auto at = bins_.find(b);
      out.push_back({std::exp2(0.5 * b), std::exp2(0.5 * (b + 1)), at == bins_.end() ? 0 : at->second});
    }
    return out;
  }

 private:
  std::map<int, std::uint64_t> bins_;
};

std::vector<ColumnRange> results(const std::vector<RangeOf>& ranges) {
  std::vector<ColumnRange> out;
  out.reserve(ranges.size());
  for (const RangeOf& range : ranges) out.push_back(range.result());
  return out;
}

/// The box, from the ranges of x y z, which come first.
template <class Info>
void set_box(Info& info) {
  for (std::size_t k = 0; k < 3; ++k) {
    info.low[k] = info.columns[k].low;
    info.high[k] = info.columns[k].high;
  }
}

}  // namespace

PointsInfo describe_points(PointSource& source, const RunContext& run) {
  const PointSourceInfo& has = source.info();
  PointsInfo info;
  info.count = has.count;
  info.double_precision = has.double_precision;
  info.crs = has.crs;
  const ScalarType position = has.double_precision ? ScalarType::float64 : ScalarType::float32;
  std::vector<RangeOf> ranges;
  for (const char* axis : {"x", "y", "z"}) ranges.emplace_back(axis, position);
  if (has.has_normals)
    for (const char* axis : {"nx", "ny", "nz"}) ranges.emplace_back(axis, ScalarType::float32);
  if (has.has_radius) ranges.emplace_back(has.radius_name, ScalarType::float32);
  if (has.has_quality) ranges.emplace_back(has.quality_name, ScalarType::float32);
  for (const AttributeSpec& spec : has.attributes) ranges.emplace_back(spec.name, spec.type);

  RadiusBins radii;
  RangeOf lengths("length", ScalarType::float32);
  edit::for_each_batch(
      source, "read", run, [](SampleBatch&) {},
      [&](const SampleBatch& b) {
        auto range = ranges.begin();
        const auto look = [&](const auto& column, bool there) {
          if (there) (range++)->add_all(column);
        };
        for (const auto* axis : {&b.x, &b.y, &b.z}) look(*axis, true);
        for (const auto* axis : {&b.nx, &b.ny, &b.nz}) look(*axis, has.has_normals);
        look(b.radius, has.has_radius);
        look(b.quality, has.has_quality);
        for (std::size_t a = 0; a < has.attributes.size(); ++a) {
          if (a < b.exact.size() && !b.exact[a].empty()) {
            look(b.exact[a], true);
          } else {
            look(b.attributes[a], true);
          }
        }
        for (std::size_t i = 0; i < b.nx.size(); ++i) lengths.add(std::hypot(b.nx[i], b.ny[i], b.nz[i]));
        for (const float r : b.radius) radii.add(r);
        for (std::size_t i = 0; i < b.size(); ++i) info.bad_rows += is_finite_row(b, i) ? 0 : 1;
      });
  info.columns = results(ranges);
  set_box(info);
  info.normal_length_low = lengths.result().low;
  info.normal_length_high = lengths.result().high;
  info.radii = radii.result();
  return info;
}

MeshInfo describe_mesh(const TriangleMesh& mesh) {
  MeshInfo info;
  info.vertices = mesh.positions.size();
  info.triangles = mesh.triangles.size();
  std::vector<RangeOf> ranges;
  for (const char* axis : {"x", "y", "z"}) ranges.emplace_back(axis, ScalarType::float64);
  if (!mesh.normals.empty())
    for (const char* axis : {"nx", "ny", "nz"}) ranges.emplace_back(axis, ScalarType::float32);
  for (const AttributeSpec& spec : mesh.layout) ranges.emplace_back(spec.name, spec.type);
  for (const auto& p : mesh.positions)
    for (std::size_t k = 0; k < 3; ++k) ranges[k].add(p[k]);
  for (const auto& n : mesh.normals)
    for (std::size_t k = 0; k < 3; ++k) ranges[3 + k].add(n[k]);
  const std::size_t first = mesh.normals.empty() ? 3 : 6;
  for (std::size_t a = 0; a < mesh.attributes.size(); ++a) ranges[first + a].add_all(mesh.attributes[a]);
  info.columns = results(ranges);
  set_box(info);
  return info;
}

}  // namespace lamina
