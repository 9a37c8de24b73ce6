// Points with normals on surfaces that are known exactly, meshes and procedural shapes; and a simulated scanner.
#pragma once
#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "lamina/mesh.h"
#include "lamina/run.h"

namespace lamina {

/// Points on a surface, by number: sample i is a function of (surface, seed, i) alone, so that any part of a cloud of
/// any size can be made anywhere. Neighbouring numbers are unrelated places.
class Surface {
 public:
  /// In the units of the mesh or shape.
  struct Point {
    std::array<double, 3> position{};
    std::array<double, 3> normal{};  ///< unit, outwards
    std::array<float, 3> colour{};   ///< 0-255, where has_colour()
  };
  struct Box {
    std::array<double, 3> low{}, high{};
  };
  virtual ~Surface() = default;
  Surface(const Surface&) = delete;
  Surface& operator=(const Surface&) = delete;
  /// A point by number and attempt, uniform by area over both. Safe from several threads.
  [[nodiscard]] virtual Point point(std::uint64_t seed, std::uint64_t sample, std::uint32_t attempt) const = 0;
  [[nodiscard]] virtual double area() const = 0;  ///< within a percent, where sampling rejects
  [[nodiscard]] virtual Box box() const = 0;
  [[nodiscard]] virtual bool has_colour() const = 0;

 protected:
  Surface() = default;
};

/// The surface of a mesh, which must outlive it. Normals are interpolated from the mesh's or, where it has none, from
/// area-weighted ones of its vertices; colours are interpolated where it has `red green blue`. Throws Error(unreadable)
/// when the mesh has no triangles or no area.
std::unique_ptr<Surface> mesh_surface(const TriangleMesh& mesh);

/// The names of the procedural shapes: sphere (radius 1), torus (radii 1 and 0.4), plane (2 x 2, z = 0, open), cube
/// (side 2), thin-sheet (a closed slab 2 x 2 x 0.02), bumpy-sphere (a sphere with smooth bumps), statue (3 high, a
/// draped figure with nine octaves of chisel marks, the finest 0.0013 wide: nine samples across with 380 million
/// samples). Normals are exact. Sphere, torus, plane, cube and thin-sheet are sampled exactly by area; bumpy-sphere and
/// statue by rejection with a bound found by probing: the density is off by a few percent at most.
std::vector<std::string> shape_names();
/// A procedural shape by name. `colours`: give it a smooth pattern of the position. Throws Error(usage) for an unknown
/// name, listing the known ones.
std::unique_ptr<Surface> shape_surface(const std::string& name, bool colours);

/// What to scatter.
struct ScatterSettings {
  std::uint64_t count = 1'000'000;  ///< samples, > 0
  std::uint64_t seed = 1;
  double noise = 0;  ///< k >= 0: moves every coordinate uniformly within [-k r / 2, k r / 2], r the local spacing
  double density_ratio = 1;  ///< 1..1e6, densest over sparsest part: falls exponentially along the box's longest axis
  bool colours = true;       ///< write red green blue where the surface has them
  bool double_positions = false;  ///< else float
};

/// The cloud written.
struct ScatterReport {
  double area = 0;     ///< of the surface
  double spacing = 0;  ///< sqrt(area / count), also where the density varies
};

/// Writes points spread independently at random over a surface as binary little-endian PLY: x y z, nx ny nz, and red
/// green blue (uchar). "-" is standard output; a file appears under its name when it is complete. The local spacing is
/// sqrt(1 / samples per area). Memory does not grow with count; the bytes do not depend on threads.
/// Throws Error(usage) for settings out of range, Error(budget) when the file cannot be written, Error(internal) when
/// cancelled.
ScatterReport scatter(const Surface& surface, const ScatterSettings& settings, const std::string& path,
                      const RunContext& run = {});

/// What to scan.
struct ScanSettings {
  int views = 12;                 ///< 1..10000, from directions spread evenly over the sphere
  std::uint64_t count = 200'000;  ///< > 0: samples of all views together, met within a few percent
  double noise = 0.15;            ///< >= 0: standard deviation along the line of sight, in grid spacings
  double normal_noise = 0.03;     ///< >= 0: standard deviation of the components of the normals
  double least_facing = 0.2;      ///< in [0, 1): surface seen at a smaller cosine is lost, as with real scanners
  std::uint64_t seed = 1;
};

/// The scan written.
struct ScanReport {
  std::uint64_t samples = 0;
  double spacing = 0;  ///< mesh units: of every view's grid, across the line of sight
};

/// Looks at the mesh from each view along parallel rays on a square grid and writes what they hit first, where that is
/// an outside: x y z, nx ny nz, red green blue (uchar, where the mesh has colours) and confidence (the cosine between
/// normal and line of sight). As in real scans, views overlap and the density falls where the surface turns away. Views
/// are written one after the other, row by row. Binary little-endian PLY, which appears under its name when it is
/// complete. The bytes do not depend on threads or processor. Memory grows with count. Throws Error(usage) for settings
/// out of range, Error(unreadable) for a mesh without triangles, Error(empty) when no ray hits an outside,
/// Error(budget) when the file cannot be written.
ScanReport scan(const TriangleMesh& mesh, const ScanSettings& settings, const std::string& path,
                const RunContext& run = {});

/// An amphora, 1.5 high, of about half a million triangles with colours: a footed belly with flutes and a relief band,
/// a glaze pattern and two handles of radius 0.035, which pass through the wall. The wall is one sheet, open at the
/// rim.
TriangleMesh amphora_mesh();

}  // namespace lamina
