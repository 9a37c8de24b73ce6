// Pictures of meshes, point clouds, level sets and fogs, drawn in software on machines without a screen; and numbers on
// a surface as colours.
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
#include "lamina/volume.h"

namespace lamina {

/// sRGB pixels of three bytes (red, green, blue), row by row from the top.
struct Image {
  int width = 0, height = 0;
  std::vector<std::uint8_t> pixels;
  [[nodiscard]] std::array<std::uint8_t, 3> at(int x, int y) const;  ///< 0 <= x < width, 0 <= y < height
};

/// What surfaces and points are coloured by.
enum class ColourMode {
  automatic,  ///< their own colours where they have any, else one clay-like colour
  none,       ///< one clay-like colour
  normals,    ///< the normal's components as red, green, blue
};

/// Size, camera and look of a picture. The camera is orthographic; back faces are blue, so that holes and turned
/// triangles show.
struct RenderSettings {
  /// A place to look at: the ball around `centre` fills the picture, and what lies more than the radius in front of the
  /// centre is cut away.
  struct Zoom {
    std::array<double, 3> centre{};  ///< input coordinates
    double radius = 1;               ///< input units, > 0
  };

  int width = 1024, height = 1024;  ///< pixels of the whole picture, 1 to 16384 each
  int supersample = 2;              ///< samples across a pixel, 1 to 8
  int views = 1;                    ///< 1 to 16 views around the up axis, side by side at one scale
  double azimuth = 30;              ///< degrees around the up axis, counter-clockwise seen from above; 0 is the front
  double elevation = 20;            ///< degrees above the horizon, -90 to 90
  int up = 1;                       ///< axis that points up: 0, 1, 2; the front is +z for 0 and 1, -y for 2
  std::optional<Zoom> zoom;         ///< unset: everything framed is in the picture
  int frames = 1;                   ///< 1 to 9999 pictures of one turn around the up axis at one scale: Renderer::turn
  ColourMode colour = ColourMode::automatic;
  bool flat = false;           ///< one shade per triangle instead of interpolated normals
  bool wire = false;           ///< dark lines along the triangles' edges
  bool mark_boundary = false;  ///< edges of only one triangle in red, in front of everything
  double point_radius = 0;     ///< input units; 0: half a point's own radius, else chosen from the density
};

/// Draws into one picture: first frame() everything, then draw() it. The picture is the same for any number of threads.
class Renderer {
 public:
  /// Throws Error(usage) when a setting is out of range, Error(budget) when the picture exceeds context.max_memory.
  Renderer(const RenderSettings& settings, const RunContext& context);
  ~Renderer();
  Renderer(const Renderer&) = delete;
  Renderer& operator=(const Renderer&) = delete;

  /// Makes room in the picture for the vertices, points, surface or fog. What is not finite is left out here and in
  /// draw().
  void frame(const TriangleMesh& mesh);
  void frame(const SampleBatch& points);
  void frame(const LevelSet& level_set);
  void frame(const FogVolume& fog);

  /// Begins picture `frame` of RenderSettings::frames, from 0 on: an empty one, the camera turned by 360 / frames
  /// degrees for each frame. Throws Error(usage) when there is no such frame.
  void turn(int frame);

  /// Draws triangles; a mesh without normals gets them from its triangles. Throws Error(unreadable) for a vertex index
  /// out of range. This and the other draw()s throw Error(internal) when cancelled.
  void draw(const TriangleMesh& mesh);
  /// Draws points as discs across their normals, or facing the viewer where they have none. `layout`: of their
  /// attributes.
  void draw(const SampleBatch& points, const AttributeLayout& layout);
  /// Casts a ray per sample at the surface, where the distance is 0, in the colours of the file's grid `Cd`. Where the
  /// level set is open the end of its band is not drawn. Lines of triangles, flat shading and boundary edges need a
  /// mesh: see mesh_level_set().
  void draw(const LevelSet& level_set);
  /// Marches a ray per sample through the densities: at density 1, a thirty-sixth of the diagonal of the fog's box lets
  /// a third of the light through. Shaded by the gradient of the density, in the colours of the file's grid `Cd`.
  void draw(const FogVolume& fog);

  /// Boundary edges drawn so far (per mesh, not per view); 0 unless RenderSettings::mark_boundary.
  [[nodiscard]] std::uint64_t boundary_edges() const;
  /// True while nothing is visible, such as when a zoom misses the model.
  [[nodiscard]] bool blank() const;
  /// The picture as it is now.
  [[nodiscard]] Image finish() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// The picture of one mesh. Throws as Renderer does.
Image render(const TriangleMesh& mesh, const RenderSettings& settings, const RunContext& context = {});

/// Writes a PNG, which appears under its name when it is complete; "-" is standard output. Throws Error(budget) when it
/// cannot be written.
void write_png(const Image& image, const std::string& path);

/// The values of the first and the last colour; values beyond take the same.
struct PaintRange {
  double low = 0, high = 1;
};

/// Exact distance from every vertex of `mesh` to the triangles of `truth`, input units; NaN for a vertex that is not
/// finite. The same bits for any number of threads. Throws Error(unreadable) when the truth has no triangles,
/// Error(internal) when cancelled.
std::vector<double> vertex_distances(const TriangleMesh& mesh, const TriangleMesh& truth, const RunContext& run = {});

/// From the least value (0 where none is negative) to the 99 % quantile of the finite values; 0 to 0 without any.
PaintRange paint_range(std::vector<double> values);

/// The sRGB colour of a value, from dark blue by turquoise, yellow-green and orange to dark red; grey for NaN and
/// infinity.
std::array<std::uint8_t, 3> paint_colour(double value, const PaintRange& range);

/// Gives every vertex the colour of its value, in place of any colours. Throws Error(internal) unless `values` has one
/// entry per vertex.
void paint(TriangleMesh& mesh, const std::vector<double>& values, const PaintRange& range);

/// Distances of any number of points from one mesh.
class DistanceField {
 public:
  /// Throws Error(unreadable) when the truth has no triangles.
  explicit DistanceField(TriangleMesh truth);
  ~DistanceField();
  DistanceField(const DistanceField&) = delete;
  DistanceField& operator=(const DistanceField&) = delete;
  /// Exact distance from every point to the nearest triangle, input units; NaN for a point that is not finite. Throws
  /// Error(internal) when cancelled.
  [[nodiscard]] std::vector<double> of(const SampleBatch& points, const RunContext& run = {}) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// The values of the attribute `name`, or of the radius (`radius`, `pscale`) or quality (`quality`, `confidence`);
/// empty where the points have none of that name.
std::vector<double> point_values(const SampleBatch& points, const AttributeLayout& layout, const std::string& name);

/// Gives every point the colour of its value, in place of all its attributes. Throws Error(internal) unless `values`
/// has one entry per point.
void paint(SampleBatch& points, AttributeLayout& layout, const std::vector<double>& values, const PaintRange& range);

/// paint_range() of values that come in batches: exact up to a million values, from at least half a million evenly
/// chosen ones beyond.
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
