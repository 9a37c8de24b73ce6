// From what the user names to files with their poses.
#include <fmt/format.h>
#include <glob.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <optional>
#include <system_error>

#include "base/number.h"
#include "lamina/error.h"
#include "lamina/points.h"
#include "points/input_file.h"
#include "points/sniff.h"
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

}  // namespace lamina
