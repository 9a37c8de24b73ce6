// Normals of organised scans: what the faces between neighbouring places of the grid say, on the scanner's side.
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "lamina/points.h"
#include "lamina/run.h"
#include "normals/viewpoints.h"
#include "points/scan_grid.h"

namespace lamina::normals {

struct GridNormals {
  std::unique_ptr<PointSource> source;  ///< the same rows; those without a normal have 0 0 0
  std::uint64_t found = 0;
};

/// A sample's normal is the sum of the faces around it (and of the next ring's where these are near its plane), so it
/// lies on the side the scanner saw. Faces that the scanner would have seen at more than 80 degrees join a thing to
/// what stands behind it and do not count; a sample with fewer than three of its four faces gets no normal. `seen` says
/// where the scanners stood, row by row (ascending); grids that it does not know the scanner of get no normals either.
///
/// Reads the source once; memory: a few lines of a grid, and a bit for each of its places. Normals rest in an unnamed
/// file in `directory`, 12 bytes a row. Throws Error(budget) when it cannot be written, and what the source throws.
GridNormals grid_normals(std::unique_ptr<PointSource> source, const std::vector<PlacedGrid>& grids,
                         const std::vector<SeenFrom>& seen, const std::string& directory, const RunContext& run);

}  // namespace lamina::normals
