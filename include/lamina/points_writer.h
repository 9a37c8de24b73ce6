// Point files, written in batches of rows: the counterpart of points.h.
#pragma once
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "lamina/attributes.h"
#include "lamina/points.h"
#include "lamina/sample.h"

namespace lamina {

/// What the rows of a point file hold, in this order: x y z, nx ny nz, radius, quality, attributes.
struct PointColumns {
  bool double_positions = false;  ///< else float
  bool normals = false;           ///< nx ny nz, float
  std::string radius{};           ///< name of the column (radius, pscale), float; empty: none
  std::string quality{};          ///< name of the column (quality, confidence), float; empty: none
  AttributeLayout attributes{};   ///< in their own types
  bool operator==(const PointColumns&) const = default;
};

/// The columns of a source, under its own names.
PointColumns columns_of(const PointSourceInfo& info);

/// How a file is written.
struct PointsWriterSettings {
  std::optional<std::uint64_t> count{};  ///< rows to come, where known: a pipe then gets rows as they are appended
  std::string tmp_dir{};                 ///< for rows that must wait; empty: next to the output (a pipe: the system's)
  std::vector<std::string> comments{};   ///< one line each, where the format has room for them
  std::string crs{};                     ///< PointSourceInfo::crs, where the format has room for it
  bool geographic = false;               ///< that is a system of degrees
};

/// Takes rows in batches and holds less than a megabyte of them, of LAZ 400 000 rows, whatever their number. The bytes
/// written depend on the rows alone, not on how they were cut into batches or whether their number was known. One
/// thread at a time. After an error the writer can only be destroyed.
///
/// The file appears under its name when commit() returns; without commit() nothing is left of it. Standard output,
/// pipes and devices cannot be taken back: where the number of rows is known they get rows at once, else all rows at
/// commit(), until when these wait in an unnamed file in `tmp_dir`.
class PointsWriter {
 public:
  virtual ~PointsWriter() = default;
  PointsWriter(const PointsWriter&) = delete;
  PointsWriter& operator=(const PointsWriter&) = delete;
  [[nodiscard]] const PointColumns& columns() const { return columns_; }
  [[nodiscard]] std::uint64_t rows() const { return rows_; }  ///< appended so far

  /// Adds the batch's rows. The batch must have the arrays of the columns, its attributes in their order; a normal,
  /// radius or quality that is not among the columns is ignored. Integers are rounded and clamped to their type; values
  /// of types that a float cannot hold come from SampleBatch::exact where it has them. Throws Error(internal) naming
  /// row and column when an array is missing or a number is not finite (or too large for its type), Error(budget)
  /// naming the file when the disk is full.
  virtual void append(const SampleBatch& batch) = 0;

  /// Completes the file. Throws Error(budget) when it cannot be written, Error(internal) when fewer or more rows came
  /// than PointsWriterSettings::count promised.
  virtual void commit() = 0;

 protected:
  explicit PointsWriter(PointColumns columns) : columns_(std::move(columns)) {}
  PointColumns columns_;
  std::uint64_t rows_ = 0;
};

/// Opens a point file for writing. The ending of `path` chooses the format: .ply (binary little-endian), .xyz and .csv
/// (text below a line of names), .pcd (binary), .las and .laz (1.4: rows wait until commit(), and coordinates are
/// rounded to a power of ten of about 2e-10 of the extent). "-" is standard output; it, pipes and devices get PLY.
/// docs/formats.md says what becomes of each column. Throws Error(usage) for another ending, naming the known ones, and
/// when standard output is a terminal; Error(budget) naming path and reason when the file cannot be written;
/// Error(internal) for column names that the format cannot hold.
std::unique_ptr<PointsWriter> open_points_writer(const std::string& path, const PointColumns& columns,
                                                 const PointsWriterSettings& settings = {});

}  // namespace lamina
