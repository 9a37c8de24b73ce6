// What is known of scans: the places of an organised one, line by line as the scanner swept, and the pose.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "lamina/points.h"

namespace lamina {

/// Which places have a row. Rows stand in the order of the places; places without a return have none.
class ScanGrid {
 public:
  /// `length`: places of a line, >= 1.
  explicit ScanGrid(std::uint64_t length) : length_(length) {}
  /// The next place. Memory: a bit.
  void add(bool filled);
  [[nodiscard]] std::uint64_t length() const { return length_; }
  [[nodiscard]] std::uint64_t lines() const { return (filled_.size() + length_ - 1) / length_; }
  [[nodiscard]] std::uint64_t rows() const { return rows_; }
  /// Whether place `at` of a line has a row; false beyond the last place.
  [[nodiscard]] bool has(std::uint64_t line, std::uint64_t at) const {
    const std::uint64_t place = line * length_ + at;
    return place < filled_.size() && filled_[place];
  }

 private:
  std::uint64_t length_;
  std::vector<bool> filled_;
  std::uint64_t rows_ = 0;
};

struct PlacedGrid {
  std::uint64_t first = 0;  ///< row of the source that is the grid's first
  std::shared_ptr<const ScanGrid> grid;
};

/// What sources of organised scans are, too.
class OrganisedPoints {
 public:
  virtual ~OrganisedPoints() = default;
  /// Ascending; rows between them belong to none.
  [[nodiscard]] virtual std::vector<PlacedGrid> grids() const = 0;

 protected:
  OrganisedPoints() = default;
  OrganisedPoints(const OrganisedPoints&) = default;
  OrganisedPoints& operator=(const OrganisedPoints&) = default;
};

/// The same points, with the one grid that all of them belong to.
std::unique_ptr<PointSource> organised_points(std::unique_ptr<PointSource> source,
                                              std::shared_ptr<const ScanGrid> grid);

/// None where nothing is known.
std::vector<PlacedGrid> grids_of(const PointSource& source);

/// Points moved into a pose.
class PoseTransform {
 public:
  /// Throws Error(unreadable), beginning with `name`, for a pose that is singular, not affine or not finite.
  PoseTransform(const Pose& pose, const std::string& name);
  /// Moves rows [begin, end) of the batch.
  void apply(SampleBatch& batch, std::size_t begin, std::size_t end) const;
  /// A point, or a direction, which stays where it is.
  [[nodiscard]] std::array<double, 3> moved(const std::array<double, 3>& p, bool direction) const;

 private:
  Pose pose_;
  double normal_[3][3] = {};
  double radius_ = 1;
};

}  // namespace lamina
