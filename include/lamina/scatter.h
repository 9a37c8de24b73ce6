// Samples of meshes and of procedural shapes with known truth, and a make-believe scanner.
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
  /// A point by number and try, uniform by area over both; safe from several threads.
  [[nodiscard]] virtual Point point(std::uint64_t seed, std::uint64_t sample, std::uint32_t attempt) const = 0;
  [[nodiscard]] virtual double area() const = 0;
  [[nodiscard]] virtual Box box() const = 0;
  [[nodiscard]] virtual bool has_colour() const = 0;

 protected:
  Surface() = default;
};

/// The surface of a mesh: normals interpolated from the mesh's or, where it has none, from area-weighted ones of its
/// vertices; colours interpolated where it has `red green blue`. The mesh must outlive it. Throws Error(unreadable)
/// when the mesh has no triangles or no area.
std::unique_ptr<Surface> mesh_surface(const TriangleMesh& mesh);

/// The procedural shapes: sphere (radius 1), torus (radii 1 and 0.4), plane (2 x 2, z = 0, open), cube (side 2),
/// thin-sheet (a closed slab 2 x 2 x 0.02), bumpy-sphere (a sphere with smooth bumps), statue (3 high, a draped figure
/// with nine octaves of chisel marks, the finest 0.0013 wide: some nine samples across when 380 million are taken).
/// Normals are exact. Sphere, torus, plane, cube and thin-sheet are sampled exactly by area; bumpy-sphere and statue
/// reject by an area bound found by probing: no place is off by more than a few percent.
std::vector<std::string> shape_names();
/// `colours`: an analytic pattern of the position. Throws Error(usage) for an unknown name, listing the known ones.
std::unique_ptr<Surface> shape_surface(const std::string& name, bool colours);

struct ScatterSettings {
  std::uint64_t count = 1'000'000;  ///< samples, > 0
  std::uint64_t seed = 1;
  double noise = 0;  ///< k: every coordinate moves by a uniform amount within [-k r / 2, k r / 2], r = local spacing
  double density_ratio = 1;  ///< >= 1: densest over sparsest part; falls by octaves along the box's longest axis
  bool colours = true;       ///< write red green blue where the surface has them
  bool double_positions = false;
};

/// What a cloud came out as.
struct ScatterReport {
  double area = 0;
  double spacing = 0;  ///< sqrt(area / count); of the whole, where the density varies
};

/// Writes `count` points as binary little-endian PLY: x y z, nx ny nz, and red green blue (uchar). Beside the output,
/// then renamed; "-" is standard output. Memory does not depend on count; the bytes do not depend on the threads.
/// Local spacing is sqrt(1 / samples per area), a cloud spread uniformly at random: no grid, no blue noise.
/// Throws Error(usage) for settings out of range, Error(budget) when the file cannot be written.
ScatterReport scatter(const Surface& surface, const ScatterSettings& settings, const std::string& path,
                      const RunContext& run = {});

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
