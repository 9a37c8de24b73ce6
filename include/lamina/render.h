// Pictures of meshes, point clouds, level sets and fogs, drawn in software: to look at a result on a machine without a
// screen; numbers on a surface as colours.
#pragma once
#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "lamina/attributes.h"
#include "lamina/mesh.h"
#include "lamina/run.h"
#include "lamina/sample.h"
#include "lamina/volume.h"

namespace lamina {

/// Eight-bit sRGB pixels, three bytes each, rows from the top.
struct Image {
  int width = 0, height = 0;
  std::vector<std::uint8_t> pixels;
  [[nodiscard]] std::array<std::uint8_t, 3> at(int x, int y) const;
};

enum class ColourMode {
  automatic,  ///< the vertices' or points' own colours where there are any, else one clay-like colour
  none,       ///< one colour
  normals,    ///< the normal's components as red, green, blue
};

/// The camera is orthographic. Back faces are tinted blue, so holes and turned triangles show.
struct RenderSettings {
  /// A place to look at: the ball around `centre` fills the picture; what lies more than the radius before it is cut
  /// away.
  struct Zoom {
    std::array<double, 3> centre{};  ///< input coordinates
    double radius = 1;               ///< input units, > 0
  };

  int width = 1024, height = 1024;  ///< pixels of the whole picture, 1 to 16384 each
  int supersample = 2;              ///< samples per pixel and direction, 1 to 8
  int views = 1;                    ///< 1 to 16 views from around the up axis, side by side at one scale
  double azimuth = 30;              ///< degrees around the up axis, counter-clockwise seen from above; 0 is the front
  double elevation = 20;            ///< degrees above the horizon, -90 to 90
  int up = 1;                       ///< axis that points up: 0, 1, 2; the front is +z for 0 and 1, -y for 2
  std::optional<Zoom> zoom;         ///< otherwise everything framed is in the picture
  int frames = 1;                   ///< 1 to 9999 pictures of one turn around the up axis at one scale: Renderer::turn
  ColourMode colour = ColourMode::automatic;
  bool flat = false;           ///< one shade per triangle instead of interpolated normals
  bool wire = false;           ///< dark lines along the triangles' edges
  bool mark_boundary = false;  ///< edges of only one triangle in red, over everything
  double point_radius = 0;     ///< input units; 0: half a sample's own radius, or else chosen from density
};

/// Draws into one picture: frame everything first, then draw it. The picture is the same for any number of threads.
class Renderer {
 public:
  /// Throws Error(usage) when a setting is out of its range, Error(budget) when the picture exceeds the memory limit.
  Renderer(const RenderSettings& settings, const RunContext& context);
  ~Renderer();
  Renderer(const Renderer&) = delete;
  Renderer& operator=(const Renderer&) = delete;

  /// Makes room in the picture for the vertices, points or surface; what is not finite is left out here and in drawing.
  void frame(const TriangleMesh& mesh);
  void frame(const SampleBatch& points);
  void frame(const LevelSet& level_set);
  void frame(const FogVolume& fog);

  /// Begins picture `frame` of RenderSettings::frames, 0 first: it is empty again, the camera stands 360/frames degrees
  /// further around for each frame. Throws Error(usage) when there is no such frame.
  void turn(int frame);

  /// Draws triangles; a mesh without normals gets them from its triangles.
  void draw(const TriangleMesh& mesh);
  /// Draws points as discs across their normals, or facing the viewer where they have none.
  void draw(const SampleBatch& points, const AttributeLayout& layout);
  /// Casts a ray per sample at the surface, where the distance is 0; smooth, in the colours of the file's grid `Cd`.
  /// The band's rim is not drawn where the level set is open. Triangles' lines, flat shading and boundary edges need a
  /// mesh: see mesh_level_set().
  void draw(const LevelSet& level_set);
  /// Marches a ray per sample through the densities; a thirty-sixth of the fog's box at density 1 lets a third of the
  /// light through. Shaded where the density changes, in the colours of the file's grid `Cd`.
  void draw(const FogVolume& fog);

  /// Boundary edges drawn so far (per mesh, not per view); 0 unless RenderSettings::mark_boundary.
  [[nodiscard]] std::uint64_t boundary_edges() const;
  /// True as long as nothing is to be seen, such as when a zoom looks beside the model.
  [[nodiscard]] bool blank() const;
  [[nodiscard]] Image finish() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Frames, draws and finishes one mesh.
Image render(const TriangleMesh& mesh, const RenderSettings& settings, const RunContext& context = {});

/// Writes a PNG beside `path`, then renames it; "-" is standard output. Throws Error(budget) when it cannot be written.
void write_png(const Image& image, const std::string& path);

/// The values that get the first and the last colour; those beyond get the same.
struct PaintRange {
  double low = 0, high = 1;
};

/// Exact distance from every vertex of `mesh` to the triangles of `truth`, input units. The same for any number of
/// threads. Throws Error(unreadable) when the truth has no triangles.
std::vector<double> vertex_distances(const TriangleMesh& mesh, const TriangleMesh& truth, const RunContext& run = {});

/// From the least value, or 0 where none is negative, to the one that 99 in 100 do not exceed; finite values only.
PaintRange paint_range(std::vector<double> values);

/// The colour of a value, sRGB: dark blue, turquoise, yellow-green, orange, dark red; grey where it is not finite.
std::array<std::uint8_t, 3> paint_colour(double value, const PaintRange& range);

/// Gives every vertex the colour of its value, in place of colours it has. `values` has one entry per vertex.
void paint(TriangleMesh& mesh, const std::vector<double>& values, const PaintRange& range);

/// Distances of any number of points from one mesh.
class DistanceField {
 public:
  /// Throws Error(unreadable) when the truth has no triangles.
  explicit DistanceField(TriangleMesh truth);
  ~DistanceField();
  DistanceField(const DistanceField&) = delete;
  DistanceField& operator=(const DistanceField&) = delete;
  /// Exact distance from every point to the nearest triangle, input units; not a number where the point is none.
  [[nodiscard]] std::vector<double> of(const SampleBatch& points, const RunContext& run = {}) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// The values of an attribute of the layout, or of `radius` (`pscale`) or `quality` (`confidence`); empty where the
/// points have none of that name.
std::vector<double> point_values(const SampleBatch& points, const AttributeLayout& layout, const std::string& name);

/// Gives every point the colour of its value, in place of the attributes it has. `values` has one entry per point.
void paint(SampleBatch& points, AttributeLayout& layout, const std::vector<double>& values, const PaintRange& range);

/// paint_range() of values that come in batches, from half a million of them, evenly spread, where there are many.
class PaintScale {
 public:
  void add(const std::vector<double>& values);
  [[nodiscard]] PaintRange range() const;
  [[nodiscard]] double least() const { return least_; }  ///< of the finite values; infinite without any
  [[nodiscard]] double most() const { return most_; }

 private:
  std::vector<double> kept_;
  std::uint64_t seen_ = 0, stride_ = 1;
  double least_ = std::numeric_limits<double>::infinity(), most_ = -std::numeric_limits<double>::infinity();
};

}  // namespace lamina
