// Point files, written in batches of rows: the counterpart of points.h. One implementation per format under
// src/points/.
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

/// What the rows of a point file hold. Columns stand in this order: x y z, nx ny nz, radius, quality, attributes.
struct PointColumns {
  bool double_positions = false;  ///< else float
  bool normals = false;           ///< nx ny nz, float
  std::string radius{};           ///< name of the column (radius, pscale), float; empty: none
  std::string quality{};          ///< name of the column (quality, confidence), float; empty: none
  AttributeLayout attributes{};   ///< in their own types
  bool operator==(const PointColumns&) const = default;
};

/// The columns of a source, as it has them.
PointColumns columns_of(const PointSourceInfo& info);

struct PointsWriterSettings {
  std::optional<std::uint64_t> count{};  ///< rows to come, where known: a pipe then gets them as they are appended
  std::string tmp_dir{};                 ///< for what has to wait; empty: next to the output (a pipe: the system's)
  std::vector<std::string> comments{};   ///< a line each, where the format has room for them
};

/// Takes rows in batches and keeps less than a megabyte of them, whatever their number. The bytes depend on the rows
/// alone, not on how they were cut into batches nor on whether their number was known. One thread at a time; after an
/// error only destruction is left.
///
/// The file appears under its name when commit() returns; without commit() nothing is left. Standard output, pipes and
/// devices cannot be taken back: where the number of rows is known they get rows at once, else all of them at
/// commit(), until when they wait in an unnamed file in `tmp_dir`.
class PointsWriter {
 public:
  virtual ~PointsWriter() = default;
  PointsWriter(const PointsWriter&) = delete;
  PointsWriter& operator=(const PointsWriter&) = delete;
  [[nodiscard]] const PointColumns& columns() const { return columns_; }
  [[nodiscard]] std::uint64_t rows() const { return rows_; }  ///< appended so far

  /// Adds the batch's rows. It must have the arrays of the columns; others (a radius nobody asked for) are passed over,
  /// but attributes must be those of the columns, in their order. Integers are rounded and clamped to their type;
  /// values of types a float cannot hold come from SampleBatch::exact where it has them.
  /// Throws Error(internal) naming row and column when an array is missing or a number is not finite (or too large for
  /// its type), Error(budget) naming the file when the disk is full.
  virtual void append(const SampleBatch& batch) = 0;

  /// Completes the file. Throws Error(budget) when it cannot be written, Error(internal) when fewer or more rows came
  /// than PointsWriterSettings::count promised.
  virtual void commit() = 0;

 protected:
  explicit PointsWriter(PointColumns columns) : columns_(std::move(columns)) {}
  PointColumns columns_;
  std::uint64_t rows_ = 0;
};

/// Opens a point file for writing, its format chosen by the ending of `path`: .ply (binary little-endian), .xyz and
/// .csv (text below a line of names), .pcd (binary), .las (1.4; rows always wait until commit(), and coordinates are
/// rounded to a step of a power of ten, a 2e-10th of the extent or so). "-" is standard output, and it, pipes and
/// devices are PLY. src/points/*_writer.h say what becomes of the columns; docs/formats.md tells it to users. Throws
/// Error(usage) for another ending, naming the known ones, and when standard output is a terminal; Error(budget) naming
/// path and reason when the file cannot be written; Error(internal) for column names the format cannot hold.
std::unique_ptr<PointsWriter> open_points_writer(const std::string& path, const PointColumns& columns,
                                                 const PointsWriterSettings& settings = {});

}  // namespace lamina
