// Points and meshes changed: clipped, moved, merged, given attributes of others. Rows of points on their way from a
// source to a writer, a few batches in memory at a time: edited, or sorted where they are more than memory holds.
#pragma once
#include <Eigen/Geometry>

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "lamina/attributes.h"
#include "lamina/mesh.h"
#include "lamina/points.h"
#include "lamina/run.h"

namespace lamina {

/// Changes a batch in place: its rows may move, disappear or gain columns. Called from several threads, each with its
/// own batch.
using EditBatch = std::function<void(SampleBatch&)>;

/// What passed through.
struct EditReport {
  std::uint64_t read = 0, written = 0;
  std::uint64_t bad_rows = 0;                  ///< left out because a position or radius was not finite
  std::optional<std::uint64_t> first_bad_row;  ///< of the input, counted from 0
  std::uint64_t replaced_normals = 0;          ///< that were not finite and became 0 0 0
  std::uint64_t replaced_values = 0;           ///< of attributes and qualities, that were not finite and became 0
};

/// Passes all rows of the source through `edit` (may be empty) to the writer, in order. Rows that cannot be written are
/// left out and counted, or refused with Error(unreadable) naming the first. Does not commit the writer. The result
/// does not depend on threads. Throws what source, edit and writer throw, and Error(internal) when cancelled.
EditReport edit_points(PointSource& source, PointsWriter& writer, const EditBatch& edit, BadSamples bad,
                       const RunContext& run = {});

/// True when row i can be written: its position and radius are finite.
bool is_finite_row(const SampleBatch& batch, std::size_t i);

/// Drops rows that cannot be written, and replaces normals, qualities and attribute values that are not finite by 0.
/// `written` stays 0. What edit_points() does to each batch, for those who read batches themselves.
EditReport clean_rows(SampleBatch& batch);
/// The same for the rows i with keep[i] != 0; the others are dropped and not counted as bad.
EditReport clean_rows(SampleBatch& batch, std::vector<std::uint8_t> keep);
/// Adds the report of another batch.
void add(EditReport& total, const EditReport& batch);
/// Throws Error(unreadable) naming `path` and the first bad row.
[[noreturn]] void refuse_bad_row(const EditReport& report, const std::string& path);

/// Warns through run.warn() of what was left out or replaced, if anything; `path` names the input.
void warn_of_bad_rows(const EditReport& report, const std::string& path, const RunContext& run);

/// What rows are sorted by.
enum class SortKey {
  x,
  y,
  z,
  sweep,      ///< along the dominant axis of the cloud, the one a reconstruction sweeps along
  spatial,    ///< along a Morton curve of 2^21 cells a side: neighbours in the file are neighbours in space
  attribute,  ///< by the values of a column
};

struct SortSettings {
  SortKey key = SortKey::spatial;
  std::string attribute;  ///< SortKey::attribute: its name
  bool reverse = false;   ///< descending
  BadSamples bad_samples = BadSamples::drop;
  std::size_t memory = std::size_t{256} << 20;  ///< for rows being sorted; at most a quarter of run.max_memory
};

/// Writes the source's rows in ascending order of their keys; equal keys keep their order, -0 and 0 are equal. Values
/// keep their bits. Does not commit the writer. Reads the input once, by `sweep` and `spatial` twice; a cloud larger
/// than settings.memory takes a temporary file of its own size in run.tmp_dir (empty: the system's). The result does
/// not depend on threads. Throws Error(usage) for an attribute that is not there, naming those that are, Error(budget)
/// when the disk is full or run.max_memory too small, and as edit_points() does.
EditReport sort_points(PointSource& source, PointsWriter& writer, const SortSettings& settings,
                       const RunContext& run = {});

// Clipping points and meshes: what lies inside a convex region of a box and half spaces stays, or what lies outside.

/// The half space `dot(normal, p - point) >= 0`.
struct HalfSpace {
  std::array<double, 3> point{};
  std::array<double, 3> normal{0, 0, 1};  ///< any length but 0
};

/// An axis-aligned box, faces included.
struct Box {
  std::array<double, 3> low{}, high{};
};

/// Which rows of an input are read at all; the others are never stored.
struct RowPick {
  std::optional<Box> clip;  ///< faces included; input coordinates
  std::uint64_t every = 1;  ///< >= 1: takes the first of every so many rows
  [[nodiscard]] bool takes_all() const { return !clip && every <= 1; }
};

/// A convex region: the box, faces included, and all half spaces.
struct ClipRegion {
  std::optional<Box> box;
  std::vector<HalfSpace> half_spaces;
};

/// Which side of a region stays.
enum class Keep { inside, outside };

/// True when the point lies in the region. Exact for boxes; for half spaces as exact as one dot product in double.
bool contains(const ClipRegion& region, const std::array<double, 3>& point);

/// Drops the rows of the other side; `keep` says which side stays. The others keep their order.
void clip_rows(SampleBatch& batch, const ClipRegion& region, Keep keep);

/// Cuts triangles where they cross the region's faces. New vertices interpolate normals and attributes, and the
/// triangles on both sides of an edge share them: a manifold mesh stays manifold. The cut is left open. Vertices that
/// no triangle uses any more are dropped; a mesh without triangles is clipped as points. Throws Error(usage) for a
/// region without faces, an empty box, a normal of length 0 or numbers that are not finite.
TriangleMesh clip_mesh(const TriangleMesh& mesh, const ClipRegion& region, Keep keep, const RunContext& run = {});

/// Throws Error(usage) as clip_mesh() does.
void require_sane(const ClipRegion& region);

// Moving, rotating and scaling points and meshes.

/// Applied in this order, about the pivot: scale, rotate about x, then y, then z, translate.
struct TransformSettings {
  Eigen::Vector3d scale = Eigen::Vector3d::Ones();
  Eigen::Vector3d rotate = Eigen::Vector3d::Zero();  ///< degrees
  Eigen::Vector3d translate = Eigen::Vector3d::Zero();
  Eigen::Vector3d pivot = Eigen::Vector3d::Zero();
};

/// p' = pivot + translate + R S (p - pivot). Quarter turns are exact. Throws as require_invertible() does.
Eigen::Affine3d make_transform(const TransformSettings& settings);

/// Throws Error(usage) when the matrix is not finite, its determinant is 0 (below 1e-12 of its size) or its last row is
/// not 0 0 0 1.
void require_invertible(const Eigen::Matrix4d& matrix);

/// Maps positions in double precision, normals by the inverse transpose with their length kept, and radii by the cube
/// root of the change of volume. Everything else stays.
void transform_rows(SampleBatch& batch, const Eigen::Affine3d& transform);
/// The same for a mesh. Where the map mirrors, triangles are reversed so that the outside stays outside.
void transform_mesh(TriangleMesh& mesh, const Eigen::Affine3d& transform);

/// True when rounding positions to float would cost more than a millionth of the diagonal of the box low..high.
bool wants_double(const Eigen::Vector3d& low, const Eigen::Vector3d& high);

// Several clouds or meshes as one.

/// What to do about columns that some inputs have and others lack.
enum class MixedAttributes {
  refuse,     ///< Error(unreadable) naming the column and both files
  fill,       ///< keep all columns; what an input lacks is 0, a quality 1
  intersect,  ///< keep only the columns that every input has
};

/// The columns of a file that holds all the inputs. Normals and radii cannot be made up: with `fill` they stay only
/// where every input has them. A column of different types takes a type that holds both, except for colours, which are
/// not rescaled: 8 and 16 bits together are refused. Throws Error(unreadable) for columns that do not go together,
/// naming column and files, and Error(usage) when there is no input.
PointColumns merged_columns(const std::vector<const PointSourceInfo*>& inputs, MixedAttributes mixed);

/// Appends all rows of the source, its columns brought into the writer's order by name. Otherwise as edit_points().
EditReport append_points(PointSource& source, PointsWriter& writer, BadSamples bad, const RunContext& run = {});

/// One mesh of all vertices and triangles, in order and not welded. `names` are those of the meshes, for messages.
/// Throws Error as merged_columns() does, and Error(budget) beyond 2^32 - 1 vertices.
TriangleMesh merge_meshes(std::vector<TriangleMesh> meshes, const std::vector<std::string>& names,
                          MixedAttributes mixed);

// Attributes from points to the vertices of a mesh.

/// What a vertex gets.
enum class TransferMode {
  nearest,   ///< the value of the nearest point
  weighted,  ///< the mean of the points nearer than R, with weights (1 - d^2 / R^2)^4: for colours, not for classes
};

struct TransferSettings {
  TransferMode mode = TransferMode::nearest;
  std::vector<std::string> attributes;  ///< names; empty: all that the points have
  /// Mesh units, >= 0. nearest: points farther than this count for nothing, 0: no limit. weighted: R of every point, 0:
  /// twice the point's own radius.
  double distance = 0;
  std::uint64_t points_at_once = 4'000'000;  ///< > 0, held in memory at a time: about 50 bytes each, and the attributes
};

struct TransferReport {
  std::uint64_t points = 0;       ///< with finite position and radius
  std::uint64_t unreachable = 0;  ///< vertices without a point near enough
};

/// Sets attributes of all vertices from the points near them. The points may be more than memory holds: they come in
/// portions, and every vertex searches each. Of equally near points the first counts. In `weighted` mode a vertex
/// without a point within R takes the value of the nearest one. A vertex that still has none keeps the mesh's value
/// where there is one, else gets 0. An attribute that the mesh has already takes the points' type. The result does not
/// depend on threads. Throws Error: usage (an attribute that is not there, naming those that are; weighted without
/// radii or distance), empty (no points), and what the source throws.
TransferReport transfer_attributes(PointSource& points, TriangleMesh& mesh, const TransferSettings& settings,
                                   const RunContext& run = {});

}  // namespace lamina
