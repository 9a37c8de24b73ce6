#include "points/formats.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "base/descriptor.h"
#include "base/number.h"
#include "base/output_file.h"
#include "lamina/error.h"
#include "lamina/file_ending.h"
#include "lamina/points.h"
#include "points/input_file.h"
#include "points/point_columns.h"
#include "points/text_rows.h"

namespace lamina {
namespace {

using namespace std::string_view_literals;

struct Signature {
  std::string_view start;
  std::string_view what;
};

constexpr std::string_view kOff =
    "looks like an OFF mesh; its vertices as points: lamina convert FILE --vertices -o points.ply";

constexpr std::array kSignatures{
    Signature{"# vtk DataFile", "is a VTK file; write it as PLY in ParaView or CloudCompare"},
    Signature{"CCB2",
              "is a file of CloudCompare's own; write it as PLY: CloudCompare -O FILE -C_EXPORT_FMT PLY -SAVE_CLOUDS"},
    Signature{"glTF", "is a GLB mesh; its vertices as points: lamina convert FILE --vertices -o points.ply"},
    Signature{"OCTM", "is an OpenCTM mesh; write it as PLY in MeshLab"},
    Signature{"#VRML", "is a VRML scene; write it as PLY in MeshLab"},
    Signature{"<?xml", "is XML, which holds no points known here; write them as PLY in MeshLab or ParaView"},
    Signature{"PK\x03\x04"sv, "is a zip archive; unpack it"},
    Signature{"\x28\xb5\x2f\xfd"sv, "is compressed with zstd; unpack it, or pipe it in: zstdcat FILE | lamina ... -"},
    Signature{"\xFF\xFE", "is text in UTF-16; save it as UTF-8: iconv -f UTF-16 -t UTF-8 FILE > OTHER"},
    Signature{"\xFE\xFF", "is text in UTF-16; save it as UTF-8: iconv -f UTF-16 -t UTF-8 FILE > OTHER"},
    Signature{"\xEF\xBB\xBFply",
              "begins with a byte order mark before 'ply'; save it without: tail -c +4 FILE > OTHER"},
    Signature{"OFF", kOff},
    Signature{"COFF", kOff},
    Signature{"NOFF", kOff},
    Signature{"solid ", "looks like an STL mesh; samples of it: lamina scatter FILE -o points.ply"},
    Signature{"version https://git-lfs", "is a Git LFS pointer, not the file itself; fetch it with: git lfs pull"},
    Signature{"<!DOCTYPE", "is a web page (a download that went wrong?)"},
    Signature{"<html", "is a web page (a download that went wrong?)"},
};

constexpr std::string_view kKnown =
    "PLY, OBJ, XYZ, PTS, ASC, CSV, PWN, PTX, PCD, LAS, LAZ, E57 and OpenVDB points are read";

constexpr std::array kTextEndings{".xyz"sv, ".pts"sv,  ".asc"sv,    ".csv"sv, ".pwn"sv, ".txt"sv,
                                  ".neu"sv, ".xyzn"sv, ".xyzrgb"sv, ".3d"sv,  ".dat"sv};
constexpr std::array kOtherEndings{".ply"sv, ".obj"sv, ".ptx"sv, ".pcd"sv, ".las"sv, ".laz"sv, ".e57"sv};

template <class Endings>
bool is_one_of(const Endings& endings, const std::string& ending) {
  return std::find(endings.begin(), endings.end(), ending) != endings.end();
}

/// The next line with something on it, words apart; comments are skipped where `comments` says so.
class Lines {
 public:
  explicit Lines(std::string_view text) : text_(text) {}

  bool next(std::vector<std::string_view>& words, bool comments = true) {
    while (!text_.empty()) {
      const std::size_t end = std::min(text_.find_first_of("\r\n"), text_.size());
      const std::string_view line = text_.substr(0, end);
      text_.remove_prefix(std::min(end + 1, text_.size()));
      split(line, words);
      if (!words.empty() && (!comments || !(words[0].starts_with('#') || words[0].starts_with("//")))) return true;
    }
    return false;
  }

 private:
  static void split(std::string_view line, std::vector<std::string_view>& words) {
    constexpr std::string_view kBetween = " \t\v\f,;\"";
    words.clear();
    for (std::size_t at = 0; words.size() < 256;) {
      at = line.find_first_not_of(kBetween, at);
      if (at == std::string_view::npos) return;
      const std::size_t end = std::min(line.find_first_of(kBetween, at), line.size());
      words.push_back(line.substr(at, end - at));
      at = end;
    }
  }

  std::string_view text_;
};

std::size_t numbers_in_front(const std::vector<std::string_view>& words) {
  return static_cast<std::size_t>(
      std::find_if_not(words.begin(), words.end(), [](std::string_view word) { return is_number(word); }) -
      words.begin());
}

bool names_positions(std::vector<std::string_view> words) {
  for (std::string_view& word : words) word.remove_prefix(std::min(word.find_first_not_of("#/"), word.size()));
  return !names_with_positions(words).empty();
}

/// Two counts, the scanner's place and axes, and a matrix.
bool is_ptx(std::string_view start) {
  constexpr std::array<std::size_t, 10> kNumbers{1, 1, 3, 3, 3, 3, 4, 4, 4, 4};
  Lines lines(start);
  std::vector<std::string_view> words;
  return std::all_of(kNumbers.begin(), kNumbers.end(), [&](std::size_t n) {
    return lines.next(words) && words.size() == n && numbers_in_front(words) == n;
  });
}

bool is_obj_keyword(std::string_view word) {
  constexpr std::array kWords{"v"sv, "vn"sv, "vt"sv,     "vp"sv,     "f"sv, "o"sv,
                              "g"sv, "s"sv,  "mtllib"sv, "usemtl"sv, "l"sv, "p"sv};
  return is_one_of(kWords, std::string(word));
}

/// Columns of numbers, after the count some formats begin with or a line of names.
bool is_columns(std::string_view start) {
  Lines lines(start);
  std::vector<std::string_view> words;
  if (!lines.next(words)) return false;
  if (words.size() == 1 && is_number(words[0]) && !lines.next(words)) return true;  // an empty cloud's count
  return numbers_in_front(words) >= 3 || names_positions(words);
}

std::string describe(std::string_view start) {
  if (start.empty()) return "is empty; give a point cloud";
  for (const Signature& signature : kSignatures) {
    if (start.starts_with(signature.start)) return std::string(signature.what);
  }
  if (is_scan_list(start)) return "is a list of scans; give it as a file of its own, not through a pipe or in gzip";
  return fmt::format("is no point file known here; {}", kKnown);
}

bool is_ply(std::string_view start) {
  return start.starts_with("ply") && (start.size() == 3 || "\r\n \t"sv.find(start[3]) != std::string_view::npos);
}

bool is_pcd(std::string_view start) {
  if (start.starts_with("# .PCD")) return true;
  Lines lines(start);
  std::vector<std::string_view> words;
  return lines.next(words) && (words[0] == "VERSION" || words[0] == "FIELDS") && words.size() >= 2;
}

}  // namespace

bool is_scan_list(std::string_view start) {
  Lines lines(start);
  std::vector<std::string_view> words;
  return lines.next(words) && (words[0] == "bmesh" || words[0] == "mesh" || words[0] == "camera") && words.size() >= 8;
}

bool has_point_ending(std::string_view name) {
  const std::string ending = packed_ending(name);
  return is_one_of(kTextEndings, ending) || is_one_of(kOtherEndings, ending);
}

PointFormat detect_format(std::string_view start, const std::string& name) {
  if (is_ply(start)) return PointFormat::ply;
  if (start.starts_with("\x20\x42\x44\x56"sv)) return PointFormat::vdb;
  if (start.starts_with("ASTM-E57")) return PointFormat::e57;
  if (start.starts_with("LASF")) return PointFormat::las;
  const bool refused = std::any_of(kSignatures.begin(), kSignatures.end(),
                                   [&](const Signature& s) { return start.starts_with(s.start); });
  if (!refused && !start.empty() && start.find('\0') == std::string_view::npos) {
    const std::string_view text = start.substr(start.starts_with(kByteOrderMark) ? kByteOrderMark.size() : 0);
    if (is_pcd(start)) return PointFormat::pcd;
    if (is_ptx(text)) return PointFormat::ptx;
    Lines lines(text);
    std::vector<std::string_view> words;
    const bool something = lines.next(words);
    if (something && is_obj_keyword(words[0])) return PointFormat::obj;
    if (is_columns(text)) return PointFormat::text;
    const std::string ending = packed_ending(name);
    if (ending == ".obj") return PointFormat::obj;
    if (is_one_of(kTextEndings, ending) && !is_scan_list(text)) return PointFormat::text;
  } else if (!refused && is_pcd(start.substr(0, std::min(start.find('\0'), start.size())))) {
    return PointFormat::pcd;
  }
  throw Error(ExitCode::unreadable, fmt::format("{}: {}", name, describe(start)));
}

// Points by the formats of their files: who reads them, who writes them.
namespace {

using OpenWriter = std::unique_ptr<PointsWriter> (*)(const std::string&, const PointColumns&,
                                                     const PointsWriterSettings&);

/// By the ending of the file's name.
constexpr std::array<std::pair<const char*, OpenWriter>, 7> kFormats{{{".ply", open_ply_points_writer},
                                                                      {".xyz", open_xyz_points_writer},
                                                                      {".csv", open_csv_points_writer},
                                                                      {".pcd", open_pcd_points_writer},
                                                                      {".las", open_las_points_writer},
                                                                      {".laz", open_laz_points_writer},
                                                                      {".e57", open_e57_points_writer}}};

bool is_pipe_or_device(const std::string& path) {
  std::error_code ignored;
  const auto kind = std::filesystem::status(path, ignored).type();
  return kind == std::filesystem::file_type::fifo || kind == std::filesystem::file_type::character ||
         kind == std::filesystem::file_type::socket;
}

std::unique_ptr<PointSource> open_all_points(const std::string& path, const PointSettings& settings) {
  require_columns(settings.columns);
  InputFile file = open_input(path, settings.tmp_dir);
  std::string start(kSniffBytes, '\0');
  start.resize(file.read(0, start.data(), start.size()));
  switch (detect_format(start, file.name)) {
    case PointFormat::ply:
      break;
    case PointFormat::obj:
      return open_obj(std::move(file), path);
    case PointFormat::pcd:
      return open_pcd(std::move(file), path, settings.tmp_dir);
    case PointFormat::las:
      return open_las(std::move(file), path, settings);
    case PointFormat::ptx:
      return open_ptx(std::move(file), path);
    case PointFormat::e57:
      return open_e57(std::move(file), path, settings.ignore_checksums);
    case PointFormat::vdb:
      return open_vdb(path);
    case PointFormat::text:
      return open_text(std::move(file), path, settings.columns);
  }
  return open_ply(std::move(file), path);
}

}  // namespace

std::unique_ptr<PointSource> open_points(const std::string& path, const PointSettings& settings) {
  if (!settings.project_degrees) return select_points(open_all_points(path, settings), settings.select);
  PointSettings here = settings;
  here.select.box.reset();  // it is a box in the plane
  return project_degrees(select_points(open_all_points(path, here), here.select));
}

std::unique_ptr<PointSource> open_points(const std::string& path, const std::string& tmp_dir) {
  return open_points(path, PointSettings{.tmp_dir = tmp_dir});
}

std::unique_ptr<PointSource> open_points(const std::vector<std::string>& names, const PointSettings& settings) {
  std::vector<std::unique_ptr<PointSource>> sources;
  for (const PointInput& input : expand_inputs(names)) {
    PointSettings here = settings;
    here.project_degrees = false;  // all into one plane
    // It is a box of where the pose or the plane puts the points.
    if (input.posed || settings.project_degrees) here.select.box.reset();
    std::unique_ptr<PointSource> source = open_points(input.path, here);
    if (input.posed) source = pose_points(std::move(source), input.pose, input.seen_along_z);
    sources.push_back(std::move(source));
  }
  std::unique_ptr<PointSource> joined = join_points(std::move(sources));
  return settings.project_degrees ? project_degrees(std::move(joined)) : std::move(joined);
}

std::unique_ptr<PointSource> open_points(std::unique_ptr<PointSource> source, const PointSettings& settings) {
  std::unique_ptr<PointSource> selected = select_points(std::move(source), settings.select);
  return settings.project_degrees ? project_degrees(std::move(selected)) : std::move(selected);
}

PointColumns columns_of(const PointSourceInfo& info) {
  return {info.double_precision, info.has_normals, info.radius_name, info.quality_name, info.attributes};
}

std::unique_ptr<PointsWriter> open_points_writer(const std::string& path, const PointColumns& columns,
                                                 const PointsWriterSettings& settings) {
  const std::string extension = file_ending(path);
  std::string known;
  for (const auto& [ending, open] : kFormats) {
    if (extension == ending) return open(path, columns, settings);
    known += (known.empty() ? "" : ", ") + std::string(ending);
  }
  if (path == "-" || is_pipe_or_device(path)) return open_ply_points_writer(path, columns, settings);
  if (extension == ".vdb") {
    throw Error(ExitCode::usage, fmt::format("{0}: only 'lamina convert' writes points as .vdb: pipe them to 'lamina "
                                             "convert - -o {0}'; known here are {1}",
                                             path, known));
  }
  throw Error(ExitCode::usage, fmt::format("{}: unknown point format to write; known are {}", path, known));
}

StagedRows::StagedRows(const std::string& path, const PointsWriterSettings& settings, bool at_once)
    : output_(path, settings.tmp_dir), promised_(settings.count) {
  if (output_.streams() && at_once) pipe_.emplace(output_.destination());
}

void StagedRows::check(int error) const {
  if (error != 0) report_write_error(output_.name(), error);
}

void StagedRows::require_open() const {
  if (published_) throw Error(ExitCode::internal, name() + ": is committed, nothing can be added");
}

void StagedRows::require_all(std::uint64_t rows) const {
  if (published_) throw Error(ExitCode::internal, name() + ": is committed already");
  if (!promised_ || *promised_ == rows) return;
  throw Error(ExitCode::internal, fmt::format("{}: {} rows came, {} were announced", name(), rows, *promised_));
}

void StagedRows::publish(const std::string& header, std::uint64_t bytes) {
  published_ = true;
  if (pipe_) return check(pipe_->close());
  check(pwrite_all(output_.fd(), header.data(), header.size(), 0));
  output_.complete(bytes);
}

}  // namespace lamina
