#include <string>

#include "lamina/points.h"
#include "points/input_file.h"
#include "points/las_points.h"
#include "points/obj_points.h"
#include "points/pcd_points.h"
#include "points/ply_points.h"
#include "points/ptx_points.h"
#include "points/sniff.h"
#include "points/text_layout.h"
#include "points/text_points.h"
#include "points/vdb_points.h"

namespace lamina {
std::unique_ptr<PointSource> open_points(const std::string& path, const PointSettings& settings) {
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
      return open_las(std::move(file), path);
    case PointFormat::ptx:
      return open_ptx(std::move(file), path);
    case PointFormat::vdb:
      return open_vdb(path);
    case PointFormat::text:
      return open_text(std::move(file), path, settings.columns);
  }
  return open_ply(std::move(file), path);
}

std::unique_ptr<PointSource> open_points(const std::string& path, const std::string& tmp_dir) {
  return open_points(path, PointSettings{tmp_dir, {}});
}

std::unique_ptr<PointSource> open_points(const std::vector<std::string>& names, const PointSettings& settings) {
  std::vector<std::unique_ptr<PointSource>> sources;
  for (const PointInput& input : expand_inputs(names)) {
    std::unique_ptr<PointSource> source = open_points(input.path, settings);
    if (input.posed) source = pose_points(std::move(source), input.pose, input.seen_along_z);
    sources.push_back(std::move(source));
  }
  return join_points(std::move(sources));
}

}  // namespace lamina
