// Points by the formats of their files: who reads them, who writes them.
#include <fmt/format.h>

#include <array>
#include <filesystem>
#include <string>
#include <system_error>
#include <utility>

#include "base/descriptor.h"
#include "base/output_file.h"
#include "lamina/error.h"
#include "lamina/file_ending.h"
#include "lamina/points.h"
#include "points/input_file.h"
#include "points/project_degrees.h"
#include "points/readers.h"
#include "points/select_points.h"
#include "points/sniff.h"
#include "points/writers.h"

namespace lamina {
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
