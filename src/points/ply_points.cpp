#include "points/ply_points.h"

#include "points/ply_ascii.h"
#include "points/ply_binary.h"
#include "points/ply_header.h"
#include "points/ply_range_grid.h"
#include "points/ply_rows.h"

namespace lamina {

std::unique_ptr<PointSource> open_ply(InputFile file, const std::string& path) {
  const PlyHeader header = read_ply_header(file);
  PlyRows rows = understand_vertices(header, path, file.name);
  const std::shared_ptr<const ScanGrid> grid = read_range_grid(file, header);
  std::unique_ptr<PointSource> source = header.format == PlyFormat::ascii
                                            ? open_ascii_ply(std::move(file), header, std::move(rows))
                                            : open_binary_ply(std::move(file), header, std::move(rows));
  return grid ? organised_points(std::move(source), grid) : std::move(source);
}

}  // namespace lamina
