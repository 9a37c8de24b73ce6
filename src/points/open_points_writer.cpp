#include <fmt/format.h>

#include <array>
#include <filesystem>
#include <utility>

#include "lamina/file_ending.h"
#include "lamina/error.h"
#include "lamina/points_writer.h"
#include "points/las_points_writer.h"
#include "points/pcd_points_writer.h"
#include "points/ply_points_writer.h"
#include "points/text_points_writer.h"

namespace lamina {
namespace {

using OpenWriter = std::unique_ptr<PointsWriter> (*)(const std::string&, const PointColumns&,
                                                     const PointsWriterSettings&);

/// By the ending of the file's name.
constexpr std::array<std::pair<const char*, OpenWriter>, 5> kFormats{{{".ply", open_ply_points_writer},
                                                                      {".xyz", open_xyz_points_writer},
                                                                      {".csv", open_csv_points_writer},
                                                                      {".pcd", open_pcd_points_writer},
                                                                      {".las", open_las_points_writer}}};

bool is_pipe_or_device(const std::string& path) {
  std::error_code ignored;
  const auto kind = std::filesystem::status(path, ignored).type();
  return kind == std::filesystem::file_type::fifo || kind == std::filesystem::file_type::character ||
         kind == std::filesystem::file_type::socket;
}

}  // namespace

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

}  // namespace lamina
