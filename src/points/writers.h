// The writers of points, one for each format, and what they share.
#pragma once
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/descriptor.h"
#include "base/output_file.h"
#include "lamina/points.h"

namespace lamina {

/// The file side of writers whose rows follow a header of fixed length.
class StagedRows {
 public:
  /// `at_once`: rows may go to a pipe as they come (their number is known, or the header does without).
  StagedRows(const std::string& path, const PointsWriterSettings& settings, bool at_once);

  [[nodiscard]] int fd() const { return pipe_ ? pipe_->get() : output_.fd(); }  ///< where rows go
  [[nodiscard]] const std::string& name() const { return output_.name(); }
  /// Throws Error(budget) for an errno value other than 0.
  void check(int error) const;
  /// Throws Error(internal) once the file is published.
  void require_open() const;
  /// Before the last rows are flushed: throws Error(internal) once the file is published, or when another number of
  /// rows came than PointsWriterSettings::count promised.
  void require_all(std::uint64_t rows) const;

  /// Puts the header in its place at the beginning (a pipe that got rows at once has it already) and publishes the
  /// file, `bytes` long. Throws Error(budget).
  void publish(const std::string& header, std::uint64_t bytes);

 private:
  OutputFile output_;
  std::optional<Descriptor> pipe_;
  std::optional<std::uint64_t> promised_;
  bool published_ = false;
};

/// PLY: the header for `count` rows, padded by a comment to the same length whatever the count.
std::string ply_points_header(const PointColumns& columns, const std::vector<std::string>& comments,
                              std::uint64_t count);

/// Binary little-endian PLY, as open_points_writer() describes.
std::unique_ptr<PointsWriter> open_ply_points_writer(const std::string& path, const PointColumns& columns,
                                                     const PointsWriterSettings& settings);

/// Binary PCD, the columns as its fields: red green blue of 8 bits become one `rgb`, packed the way the Point Cloud
/// Library does. As open_points_writer() describes.
std::unique_ptr<PointsWriter> open_pcd_points_writer(const std::string& path, const PointColumns& columns,
                                                     const PointsWriterSettings& settings);

/// Steps of the integer coordinates of a LAS along an axis.
struct LasAxis {
  double low = 0, high = 0;      ///< of the points
  double scale = 1, offset = 0;  ///< coordinate = integer * scale + offset
};

/// How many decimals an axis' coordinates have.
class Decimals {
 public:
  static constexpr int kMost = 10;  ///< or more: coordinates that nobody has rounded
  void add(double value);
  [[nodiscard]] int most() const { return most_; }

 private:
  int most_ = 0;
  double tenth_ = 1;  ///< 10 to the power of most_
};

/// The smallest power of ten that lets 32 bits span [low, high], but no finer than doubles are there, nor than so many
/// decimals: points of another LAS keep its steps where these are powers of ten.
LasAxis choose_steps(double low, double high, int decimals = Decimals::kMost);

/// LAS 1.4 of point format 6, or 7 where there are colours, which then have 16 bits (8-bit ones times 257, floats of
/// 0-1 times 65535). An integer `intensity` of at most 16 bits has its own place; normals, radius, quality and all else
/// are extra bytes under their names. Coordinates become integers of 32 bits with steps of a power of ten, the smallest
/// that spans the points, so rows wait in an unnamed file until commit(). As open_points_writer() describes otherwise;
/// throws Error(internal) also for names longer than 32 characters.
std::unique_ptr<PointsWriter> open_las_points_writer(const std::string& path, const PointColumns& columns,
                                                     const PointsWriterSettings& settings);

/// The same compressed: LAZ in chunks of 50 000 points.
std::unique_ptr<PointsWriter> open_laz_points_writer(const std::string& path, const PointColumns& columns,
                                                     const PointsWriterSettings& settings);

/// E57 1.0: one scan without a pose, Cartesian. Normals by the extension `nor`; radius, quality and attributes other
/// than red green blue and intensity by one of our own, under their names. As open_points_writer() describes; throws
/// Error(internal) also for names that are none of XML's.
std::unique_ptr<PointsWriter> open_e57_points_writer(const std::string& path, const PointColumns& columns,
                                                     const PointsWriterSettings& settings);

/// Text with blanks (XYZ) or commas (CSV), below a line of names. Numbers have as many digits as their type needs to
/// come back the same. As open_points_writer() describes.
std::unique_ptr<PointsWriter> open_xyz_points_writer(const std::string& path, const PointColumns& columns,
                                                     const PointsWriterSettings& settings);
std::unique_ptr<PointsWriter> open_csv_points_writer(const std::string& path, const PointColumns& columns,
                                                     const PointsWriterSettings& settings);

}  // namespace lamina
