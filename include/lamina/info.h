// What a file holds: how many points or triangles, where they lie, and the range of every column.
#pragma once
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "lamina/attributes.h"
#include "lamina/mesh.h"
#include "lamina/points.h"
#include "lamina/run.h"

namespace lamina {

enum class FileContent { points, mesh, volume };

/// The kind of a file by its first bytes and its name. .vdb files are volumes; OFF and STL files are meshes, and so are
/// OBJ and PLY files with faces, each also as .gz; everything else is taken for points, for open_points() to judge.
///
/// "-" is standard input. A pipe can be read only once: it is spooled to an unnamed file in `tmp_dir` (empty: the
/// system's), which replaces the process's standard input, so that open_points("-") and read_mesh("-") read it from its
/// beginning.
/// Throws Error(unreadable) when the file cannot be opened or read, Error(usage) when standard input is a terminal,
/// Error(budget) when there is no room to spool.
FileContent content_of(const std::string& path, const std::string& tmp_dir = {});

/// One column and the range of its finite values.
struct ColumnRange {
  std::string name;
  ScalarType type = ScalarType::float32;
  double low = 0, high = 0, mean = 0;  ///< 0 when no value is finite
  std::uint64_t values = 0;            ///< finite ones
  std::uint64_t not_finite = 0;        ///< NaN or infinite
};

/// How many values lie in [low, high).
struct HistogramBin {
  double low = 0, high = 0;
  std::uint64_t count = 0;
};

/// A cloud; lengths in the input's units.
struct PointsInfo {
  std::uint64_t count = 0;
  std::uint64_t bad_rows = 0;           ///< a position or radius is not finite
  std::array<double, 3> low{}, high{};  ///< box of the finite coordinates
  bool double_precision = false;
  std::string crs;                                       ///< PointSourceInfo::crs
  std::vector<ColumnRange> columns;                      ///< x y z, nx ny nz, radius, quality, attributes
  double normal_length_low = 0, normal_length_high = 0;  ///< 0 without normals
  std::vector<HistogramBin> radii;  ///< bins of half an octave, from the smallest to the largest radius above 0
};

/// Reads the source once, a few batches in memory at a time. Throws what the source throws, and Error(internal) when
/// cancelled.
PointsInfo describe_points(PointSource& source, const RunContext& run = {});

/// A mesh; lengths in its own units.
struct MeshInfo {
  std::uint64_t vertices = 0, triangles = 0;
  std::array<double, 3> low{}, high{};  ///< box of the finite coordinates
  std::vector<ColumnRange> columns;     ///< x y z, nx ny nz, attributes
};

/// Looks at all vertices, also those in no triangle. Throws nothing.
MeshInfo describe_mesh(const TriangleMesh& mesh);

}  // namespace lamina
