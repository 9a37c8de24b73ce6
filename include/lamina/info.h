// What is in a file: how much of it, where, and between which values.
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

/// What a file holds, by its first bytes and its name: .vdb volumes; OFF, STL, and OBJ and PLY that name faces,
/// each also as .gz: meshes; everything else: points, for open_points() to judge.
///
/// "-" is standard input. A pipe can be read only once: it is first spooled to an unnamed file in `tmp_dir` (empty: the
/// system's), which takes the place of the process's standard input, so that open_points("-") and read_mesh("-") read
/// it from its beginning.
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

struct PointsInfo {
  std::uint64_t count = 0;
  std::uint64_t bad_rows = 0;  ///< a position or radius is not finite
  std::array<double, 3> low{}, high{};
  bool double_precision = false;
  std::vector<ColumnRange> columns;  ///< x y z, nx ny nz, radius, quality, attributes
  double normal_length_low = 0, normal_length_high = 0;
  std::vector<HistogramBin> radii;  ///< half octaves, from the smallest to the largest radius above 0
};

/// Reads the source once. Throws what the source throws, and Error(internal) when cancelled.
PointsInfo describe_points(PointSource& source, const RunContext& run = {});

struct MeshInfo {
  std::uint64_t vertices = 0, triangles = 0;
  std::array<double, 3> low{}, high{};
  std::vector<ColumnRange> columns;  ///< x y z, nx ny nz, attributes
};

MeshInfo describe_mesh(const TriangleMesh& mesh);

}  // namespace lamina
