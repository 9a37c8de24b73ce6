// From what the user names to files with their poses.
#include <fmt/format.h>
#include <glob.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <limits>
#include <optional>
#include <system_error>
#include <utility>

#include "base/number.h"
#include "lamina/error.h"
#include "lamina/points.h"
#include "points/formats.h"
#include "points/input_file.h"
#include "points/point_columns.h"
#include "points/scans.h"
#include "points/text_rows.h"

namespace lamina {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void refuse(const std::string& name, const std::string& what) {
  throw Error(ExitCode::unreadable, fmt::format("{}: {}", name, what));
}

bool parse_all(const std::vector<std::string_view>& words, std::size_t from, std::vector<double>& values) {
  for (std::size_t i = from; i < words.size(); ++i) {
    double value = 0;
    if (!is_number(words[i], value)) return false;
    values.push_back(value);
  }
  return true;
}

Pose read_pose(const std::string& path) {
  const InputFile file = open_input(path, {});
  LineReader lines(file, 0, 0, line_end_of(file));
  std::string_view line;
  std::vector<std::string_view> words;
  std::vector<double> values;
  while (lines.next(line)) {
    if (is_comment(line)) continue;
    split_line(line, line.find(',') == line.npos ? kBlanks : ',', words);
    if (!parse_all(words, 0, values) || values.size() > 16) {
      refuse(path, fmt::format("line {}: a pose is 16 numbers, row by row", lines.line()));
    }
  }
  if (values.size() != 16) refuse(path, fmt::format("{} numbers; a pose is 16, row by row", values.size()));
  Pose pose{};
  for (std::size_t i = 0; i < 16; ++i) pose[i / 4][i % 4] = values[i];
  return pose;
}

/// Translation and quaternion (x y z w) of a Stanford scan list. Its points are rows: the rotation is the inverse of
/// what the quaternion says for columns.
Pose pose_of(const std::array<double, 7>& v, const std::string& place) {
  const double length = std::sqrt(v[3] * v[3] + v[4] * v[4] + v[5] * v[5] + v[6] * v[6]);
  if (!(length > 0.5 && length < 2)) refuse(place, "the quaternion is not of unit length");
  const double x = -v[3] / length;
  const double y = -v[4] / length;
  const double z = -v[5] / length;
  const double w = v[6] / length;
  return {{{1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), v[0]},
           {2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), v[1]},
           {2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), v[2]},
           {0, 0, 0, 1}}};
}

Pose product(const Pose& a, const Pose& b) {
  Pose c{};
  for (std::size_t i = 0; i < 4; ++i) {
    for (std::size_t j = 0; j < 4; ++j) {
      for (std::size_t k = 0; k < 4; ++k) c[i][j] += a[i][k] * b[k][j];
    }
  }
  return c;
}

/// `bmesh FILE tx ty tz qx qy qz qw`, one scan a line; files lie beside the list.
std::vector<PointInput> read_scan_list(const InputFile& list, const std::string& path) {
  const fs::path folder = fs::path(path).parent_path();
  LineReader lines(list, 0, 0, line_end_of(list));
  std::string_view line;
  std::vector<std::string_view> words;
  std::vector<PointInput> scans;
  while (lines.next(line)) {
    split_line(line, kBlanks, words);
    if (is_comment(line) || words[0] == "camera") continue;
    std::vector<double> values;
    const std::string place = fmt::format("{}, line {}", path, lines.line());
    if ((words[0] != "bmesh" && words[0] != "mesh") || words.size() != 9 || !parse_all(words, 2, values)) {
      refuse(place, "bmesh FILE and seven numbers expected: translation and quaternion (x y z w)");
    }
    std::array<double, 7> numbers{};
    std::copy(values.begin(), values.end(), numbers.begin());
    scans.push_back({(folder / fs::path(words[1])).string(), true, pose_of(numbers, place), true});
  }
  if (scans.empty()) refuse(path, "names no scans; bmesh lines expected");
  return scans;
}

/// The scans of a list, nothing when the file is none.
std::optional<std::vector<PointInput>> scans_of(const std::string& path) {
  std::error_code ignored;
  if (!fs::is_regular_file(path, ignored) || fs::file_size(path, ignored) > (1U << 20)) return std::nullopt;
  Descriptor file = open_to_read(path);
  if (!file) return std::nullopt;  // opening it as points will say why
  InputFile list{std::move(file), fs::file_size(path, ignored), path};
  std::string start(kSniffBytes, '\0');
  start.resize(list.read(0, start.data(), start.size()));
  if (!is_scan_list(start)) return std::nullopt;
  return read_scan_list(list, path);
}

std::vector<std::string> files_in(const std::string& folder) {
  std::vector<std::string> files;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    std::error_code ignored;
    if (it->is_regular_file(ignored) && has_point_ending(it->path().filename().string()))
      files.push_back(it->path().string());
  }
  if (error) refuse(folder, fmt::format("cannot be listed: {}", error.message()));
  if (files.empty())
    refuse(folder, "no point files are in this folder (by their endings: .ply .obj .xyz .pts .ptx .pcd .las .e57 ...)");
  std::sort(files.begin(), files.end());
  return files;
}

std::vector<std::string> files_like(const std::string& pattern) {
  glob_t found{};
  const int status = ::glob(pattern.c_str(), 0, nullptr, &found);
  std::vector<std::string> files(found.gl_pathv, found.gl_pathv + (status == 0 ? found.gl_pathc : 0));
  ::globfree(&found);
  if (files.empty()) refuse(pattern, "no file matches this pattern");
  return files;
}

bool exists(const std::string& name) {
  std::error_code ignored;
  return fs::exists(name, ignored);
}

std::vector<std::string> files_of(const std::string& name) {
  std::error_code ignored;
  if (fs::is_directory(name, ignored)) return files_in(name);
  if (!exists(name) && name.find_first_of("*?[") != std::string::npos) return files_like(name);
  return {name};
}

}  // namespace

std::vector<PointInput> expand_inputs(const std::vector<std::string>& names) {
  if (names.empty()) throw Error(ExitCode::usage, "no point files were named");
  std::vector<PointInput> inputs;
  for (const std::string& name : names) {
    if (name == "-") {
      inputs.push_back({name});
      continue;
    }
    std::string path = name;
    std::optional<Pose> pose;
    if (const std::size_t at = name.rfind('@'); at != std::string::npos && at != 0 && !exists(name)) {
      path = name.substr(0, at);
      pose = read_pose(name.substr(at + 1));
    }
    for (const std::string& file : files_of(path)) {
      std::vector<PointInput> scans = scans_of(file).value_or(std::vector<PointInput>{{file}});
      for (PointInput& scan : scans) {
        if (pose) scan.pose = product(*pose, scan.pose);
        scan.posed = scan.posed || pose;
        inputs.push_back(std::move(scan));
      }
    }
  }
  return inputs;
}

// Several sources as one stream of rows.
namespace {

/// What full brightness is in a type; 1 for floats.
double full(ScalarType type) {
  switch (type) {
    case ScalarType::uint8:
      return 255;
    case ScalarType::uint16:
      return 65535;
    default:
      return 1;
  }
}

/// A type that holds the values of both.
ScalarType wider(ScalarType a, ScalarType b) {
  if (a == b) return a;
  const auto is_unsigned = [](ScalarType t) {
    return t == ScalarType::uint8 || t == ScalarType::uint16 || t == ScalarType::uint32;
  };
  const bool integers = a < ScalarType::float32 && b < ScalarType::float32;
  if (!integers)
    return a == ScalarType::float64 || b == ScalarType::float64 ? ScalarType::float64 : ScalarType::float32;
  if (is_unsigned(a) == is_unsigned(b)) return byte_size(a) >= byte_size(b) ? a : b;
  return std::max(byte_size(a), byte_size(b)) == 4 ? ScalarType::float64 : ScalarType::int32;
}

class JoinedPoints final : public PointSource, public OrganisedPoints {
 public:
  explicit JoinedPoints(std::vector<std::unique_ptr<PointSource>> sources) {
    info_ = sources.front()->info();
    info_.count = 0;
    info_.attributes.clear();
    info_.remarks.clear();
    info_.scans.clear();
    for (auto& source : sources) add(std::move(source));
    const bool one_file =
        std::all_of(parts_.begin(), parts_.end(), [&](const Part& p) { return p.source->info().path == info_.path; });
    if (!one_file) info_.path = fmt::format("{} and {} more", info_.path, parts_.size() - 1);
    for (const Part& part : parts_) {
      const PointSourceInfo& from = part.source->info();
      if (info_.radius_name.empty()) info_.radius_name = from.radius_name;
      if (info_.quality_name.empty()) info_.quality_name = from.quality_name;
    }
    keep_if_all_have("normals", info_.has_normals, &PointSourceInfo::has_normals);
    keep_if_all_have("radii", info_.has_radius, &PointSourceInfo::has_radius);
    if (!info_.has_radius) info_.radius_name.clear();
    for (Part& part : parts_) map_attributes(part);
  }

  void read(std::uint64_t first, std::size_t count, SampleBatch& out) override {
    const RowRange rows = rows_there(info_, first, count);
    size_batch(rows, out);
    auto part = std::upper_bound(parts_.begin(), parts_.end(), rows.first,
                                 [](std::uint64_t row, const Part& p) { return row < p.first; });
    SampleBatch piece;
    std::size_t done = 0;
    if (rows.count > 0) --part;
    for (; done < rows.count; ++part) {
      const std::uint64_t begin = rows.first + done - part->first;
      part->source->read(begin, rows.count - done, piece);
      copy(*part, piece, done, out);
      done += piece.size();
    }
  }

  [[nodiscard]] std::vector<PlacedGrid> grids() const override {
    std::vector<PlacedGrid> placed;
    for (const Part& part : parts_) {
      for (const PlacedGrid& g : grids_of(*part.source)) placed.push_back({part.first + g.first, g.grid});
    }
    return placed;
  }

 private:
  struct Mapped {
    std::size_t to;
    double scale;
  };
  struct Part {
    std::uint64_t first = 0;
    std::unique_ptr<PointSource> source;
    std::vector<Mapped> attributes;  ///< of the source's
  };

  void add(std::unique_ptr<PointSource> source) {
    const PointSourceInfo& from = source->info();
    if (from.count > std::numeric_limits<std::uint64_t>::max() - info_.count) {
      throw Error(ExitCode::unreadable, fmt::format("{}: more points than can be counted", from.path));
    }
    info_.has_quality = info_.has_quality || from.has_quality;
    info_.random_access = info_.random_access && from.random_access;
    info_.double_precision = info_.double_precision || from.double_precision;
    info_.geographic = info_.geographic || from.geographic;
    info_.from_above = info_.from_above || from.from_above;
    if (info_.crs != from.crs && !from.crs.empty()) {
      if (!info_.crs.empty()) {
        info_.remarks.push_back(fmt::format("{} has the coordinate system {}, others have {}: taken as they are",
                                            from.path, crs_name(from.crs), crs_name(info_.crs)));
      } else {
        info_.crs = from.crs;
      }
    }
    info_.remarks.insert(info_.remarks.end(), from.remarks.begin(), from.remarks.end());
    for (const AttributeSpec& spec : from.attributes) {
      const auto known = std::find_if(info_.attributes.begin(), info_.attributes.end(),
                                      [&](const AttributeSpec& a) { return a.name == spec.name; });
      if (known == info_.attributes.end()) {
        info_.attributes.push_back(spec);
      } else {
        known->type = wider(known->type, spec.type);
      }
    }
    const std::uint64_t first = info_.count;
    info_.count += from.count;
    std::vector<ScanPart> scans = from.scans;
    if (scans.empty()) scans.resize(1);
    for (ScanPart& scan : scans) {
      scan.first += first;
      info_.scans.push_back(scan);
    }
    parts_.push_back({first, std::move(source), {}});
  }

  /// What only some sources have is dropped, and said so.
  void keep_if_all_have(const char* what, bool& all, bool PointSourceInfo::*has) {
    const auto lacks = [&](const Part& p) { return !(p.source->info().*has) && p.source->info().count > 0; };
    const auto without = std::find_if(parts_.begin(), parts_.end(), lacks);
    const auto with = std::find_if(parts_.begin(), parts_.end(), [&](const Part& p) { return p.source->info().*has; });
    all = without == parts_.end() && with != parts_.end();
    if (!all && with != parts_.end()) {
      info_.remarks.push_back(fmt::format("{} has no {}, {} has: left out of all", without->source->info().path, what,
                                          with->source->info().path));
    }
  }

  void map_attributes(Part& part) const {
    for (const AttributeSpec& spec : part.source->info().attributes) {
      const auto to = std::find_if(info_.attributes.begin(), info_.attributes.end(),
                                   [&](const AttributeSpec& a) { return a.name == spec.name; });
      const double scale = is_colour(spec.name) ? full(to->type) / full(spec.type) : 1;
      part.attributes.push_back({static_cast<std::size_t>(to - info_.attributes.begin()), scale});
    }
  }

  void size_batch(RowRange rows, SampleBatch& out) const {
    const std::size_t count = rows.count;
    out.first = rows.first;
    for (auto* axis : {&out.x, &out.y, &out.z}) axis->resize(count);
    for (auto* normal : {&out.nx, &out.ny, &out.nz}) normal->resize(info_.has_normals ? count : 0);
    out.radius.resize(info_.has_radius ? count : 0);
    out.quality.assign(info_.has_quality ? count : 0, 1.0F);
    out.attributes.resize(info_.attributes.size());
    for (auto& attribute : out.attributes) attribute.assign(count, 0.0F);
    out.exact.resize(info_.attributes.size());
    for (std::size_t a = 0; a < info_.attributes.size(); ++a) {
      out.exact[a].assign(fits_float(info_.attributes[a].type) ? 0 : count, 0.0);
    }
  }

  static void copy(const Part& part, const SampleBatch& piece, std::size_t at, SampleBatch& out) {
    const auto put = [&](const auto& from, auto& to) {
      if (!from.empty() && !to.empty())
        std::copy(from.begin(), from.end(), to.begin() + static_cast<std::ptrdiff_t>(at));
    };
    put(piece.x, out.x);
    put(piece.y, out.y);
    put(piece.z, out.z);
    put(piece.nx, out.nx);
    put(piece.ny, out.ny);
    put(piece.nz, out.nz);
    put(piece.radius, out.radius);
    put(piece.quality, out.quality);
    for (std::size_t a = 0; a < part.attributes.size(); ++a) {
      const Mapped& mapped = part.attributes[a];
      if (!out.exact[mapped.to].empty()) {
        double* exact = out.exact[mapped.to].data() + at;
        const bool has_exact = a < piece.exact.size() && !piece.exact[a].empty();
        for (std::size_t i = 0; i < piece.size(); ++i) {
          *exact++ = mapped.scale * (has_exact ? piece.exact[a][i] : double{piece.attributes[a][i]});
        }
      }
      float* to = out.attributes[mapped.to].data() + at;
      for (const float value : piece.attributes[a])
        *to++ = mapped.scale == 1 ? value : static_cast<float>(value * mapped.scale);
    }
  }

  std::vector<Part> parts_;
};

}  // namespace

std::unique_ptr<PointSource> join_points(std::vector<std::unique_ptr<PointSource>> sources) {
  if (sources.empty()) throw Error(ExitCode::usage, "no point files were named");
  if (sources.size() == 1) return std::move(sources.front());
  return std::make_unique<JoinedPoints>(std::move(sources));
}

}  // namespace lamina
