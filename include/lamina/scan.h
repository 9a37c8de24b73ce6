// A make-believe scanner: what a range camera sees of a mesh from several sides.
#pragma once
#include <cstdint>
#include <string>

#include "lamina/mesh.h"
#include "lamina/run.h"

namespace lamina {

struct ScanSettings {
  int views = 12;                 ///< > 0; directions spread evenly over the sphere
  std::uint64_t count = 200'000;  ///< samples of all views together; met within a few percent
  double noise = 0.15;            ///< standard deviation along the line of sight, in grid spacings
  double normal_noise = 0.03;     ///< standard deviation of the normals' components
  double least_facing = 0.2;      ///< in [0, 1): surface seen at a smaller cosine is lost, as real scanners lose it
  std::uint64_t seed = 1;
};

struct ScanReport {
  std::uint64_t samples = 0;
  double spacing = 0;  ///< of every view's grid, across the line of sight
};

/// Looks at the mesh from each view in parallel rays on a square grid and writes what the rays hit first from outside:
/// x y z, nx ny nz, red green blue (uchar, where the mesh has colours), confidence (the cosine between normal and line
/// of sight). Views follow one another, rows of a view too; density falls where the surface turns away, seen parts
/// overlap. Binary little-endian PLY, beside the output, then renamed. The bytes do not depend on threads or processor.
/// Memory grows with count. Throws Error(usage), Error(unreadable) for a mesh without triangles, Error(empty) when
/// no ray hits, Error(budget).
ScanReport scan(const TriangleMesh& mesh, const ScanSettings& settings, const std::string& path,
                const RunContext& run = {});

/// An amphora 1.5 high, about half a million triangles with colours: a footed belly with flutes and a relief band, a
/// glaze pattern, two handles of 0.035 radius, and an open rim: one sheet, no inner wall. The handles pass through the
/// wall.
TriangleMesh amphora_mesh();

}  // namespace lamina
