// Numbers on a surface as colours: distances to the truth, any attribute.
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

namespace lamina {

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
