// Point files, read and written in batches of rows. docs/formats.md describes the formats.
#pragma once
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "lamina/attributes.h"

namespace lamina {

/// One scan of an input: the rows from `first` on, up to the next scan's.
struct ScanPart {
  enum class Scanner : std::uint8_t {
    unknown,
    position,     ///< it stood at `at`
    direction,    ///< it stood far away in the direction `at`
    pose_origin,  ///< `at` is where the pose puts the origin of the file: the scanner may have stood there
  };
  std::uint64_t first = 0;
  Scanner scanner = Scanner::unknown;
  std::array<double, 3> at{};  ///< input coordinates
};

/// What a source has.
struct PointSourceInfo {
  std::string path;                  ///< as given by the user, for messages
  std::uint64_t count = 0;           ///< rows
  bool has_normals = false;          ///< nx ny nz all present
  bool found_normals = false;        ///< not the source's own: it had none, and they were found from the positions
  bool has_radius = false;           ///< by the column radius, else pscale
  bool has_quality = false;          ///< by the column quality, else confidence
  std::string radius_name;           ///< as the file calls it; empty: none
  std::string quality_name;          ///< as the file calls it; empty: none
  bool random_access = false;        ///< read() takes any row, from several threads at once
  bool double_precision = false;     ///< positions need more than float32
  bool geographic = false;           ///< x and y are degrees of longitude and latitude, in which no job can measure
  bool from_above = false;           ///< wide and flat, with the returns or classes of surveys from the air
  std::string crs;                   ///< coordinate reference system: well-known text or EPSG:NUMBER; empty: not told
  std::vector<ScanPart> scans;       ///< ascending, the first begins with row 0; empty: one scan, nothing known of it
  bool scans_told = false;           ///< that it is of several scans is known, but no longer which rows are whose
  AttributeLayout attributes;        ///< every other scalar property, in the file's order and types
  std::vector<std::string> remarks;  ///< what the user should know, one line each: guesses, things left out
};

/// Whether a cloud is known to be of several scans: by `scans`, by an attribute `scan`, or by what it was read from.
inline bool tells_scans(const PointSourceInfo& info) {
  return info.scans_told || info.scans.size() > 1 || find_attribute(info.attributes, "scan");
}

/// What people call a coordinate reference system (PointSourceInfo::crs): the name in the text, or the text itself.
std::string crs_name(const std::string& crs);

/// Throws Error(unreadable), naming what to do, where x and y are degrees.
void require_no_degrees(const PointSourceInfo& info);

/// Keeps the rows i with keep[i] != 0, in order. `keep` has one entry for each row.
void keep_rows(SampleBatch& batch, const std::vector<std::uint8_t>& keep);

/// Rows of points. One thread at a time, unless info().random_access.
class PointSource {
 public:
  virtual ~PointSource() = default;
  PointSource(const PointSource&) = delete;
  PointSource& operator=(const PointSource&) = delete;
  [[nodiscard]] const PointSourceInfo& info() const { return info_; }

  /// Reads the rows [first, first + count), clipped to info().count, into `out`, whose arrays are resized and reused.
  /// Values come as they stand in the file, also where they are not finite. Sequential sources (random_access == false)
  /// take the row after the last one read, or 0 to start over.
  /// Throws Error(unreadable) naming the file, the row or line, and what is wrong.
  virtual void read(std::uint64_t first, std::size_t count, SampleBatch& out) = 0;

 protected:
  PointSource() = default;
  PointSourceInfo info_;
};

/// What a value of a point must be, as in `intensity>10`.
struct PointCondition {
  enum class Relation : std::uint8_t { less, at_most, equal, not_equal, at_least, more };
  std::string name;  ///< x, y, z or an attribute; of LAS also classification, return_number and the other fields
                     ///< of its records (PointSettings::all_fields)
  Relation relation = Relation::equal;
  double value = 0;
};

/// NAME, one of < <= = == != >= > and a number. Throws Error(usage) for anything else.
PointCondition parse_condition(std::string_view text);

/// Which points of a file are taken; all conditions must hold.
struct PointSelection {
  enum class Returns : std::uint8_t { all, first, last };
  /// Of LAS. Kept classes: empty for all. Those dropped are noise, low and high, unless somebody says otherwise.
  std::vector<int> keep_classes{};
  std::vector<int> drop_classes{kNoise.begin(), kNoise.end()};
  Returns returns = Returns::all;       ///< of a pulse's several; of LAS
  std::vector<PointCondition> where{};  ///< of any format
  /// Of COPC: levels of the octree from the coarsest to the first whose points are no farther apart than this length.
  std::optional<double> resolution{};
  /// Of COPC: nodes that lie outside of this box, low and high, are not read; points outside may still come.
  std::optional<std::array<std::array<double, 3>, 2>> box{};

  static constexpr std::array<int, 2> kNoise{7, 18};
};

/// In one line; the same for the same selection alone.
std::string to_string(const PointSelection& selection);

/// How files are read.
struct PointSettings {
  std::string tmp_dir{};  ///< folder for what must be spooled or unpacked; empty: the system's
  /// The columns of text files (XYZ, CSV, ...): names separated by commas, as in "x,y,z,red,green,blue,-". `-` skips a
  /// column; NAME:TYPE with a PLY type fixes its type (red:ushort). Empty: taken from the file's header line, else
  /// guessed from the numbers. Other formats ignore it.
  std::string columns{};
  bool ignore_checksums = false;  ///< of E57: pages are believed whatever their checksums say
  /// x and y, which must be degrees of longitude and latitude, become metres in a plane: transverse Mercator around the
  /// whole degrees next to the first point. Heights stay.
  bool project_degrees = false;
  /// Of LAS: the fields of its records become attributes, too, where any point has them: return_number,
  /// number_of_returns, classification, class_flags, scanner_channel, scan_direction, edge_of_flight_line, scan_angle,
  /// user_data, point_source, gps_time. For jobs that write points again.
  bool all_fields = false;
  PointSelection select{};
};

/// Opens a point file by its content, and by its ending where the content does not tell the format: PLY (also with a
/// range grid), OBJ, XYZ and other text, PTX, PCD, LAS, LAZ, E57, OpenVDB points (held in memory); docs/formats.md has
/// the details.
/// "-" is standard input. Pipes are spooled to an unnamed file in `tmp_dir`, and .gz files are unpacked to one.
///
/// Properties of PLY's element `vertex`: x y z; nx ny nz; radius (else pscale); quality (else confidence). Every other
/// one is an attribute, held as float, and integers of 32 bits and doubles in SampleBatch::exact as well. Positions of
/// an ascii file keep all their digits even where the header says float, as georeferenced ones need. Binary files and
/// text files are random_access (ascii PLY is not) and never mapped: resident memory does not grow with the file.
///
/// Throws Error(unreadable) naming the file and the place: a file that is missing, a directory, empty or of unknown
/// format; a malformed header, no points, no x y z, an incomplete normal, a column named twice, a list among a PLY
/// vertex's properties, a file shorter or longer than its header says (ascii: known when the last row is read). Throws
/// Error(budget) when `tmp_dir` cannot take what is spooled, Error(usage) for columns that make no sense, and for a
/// selection by a value that the file does not have.
std::unique_ptr<PointSource> open_points(const std::string& path, const PointSettings& settings);
std::unique_ptr<PointSource> open_points(const std::string& path, const std::string& tmp_dir = {});

/// An affine map, row by row: p' = M p, the last row 0 0 0 1.
using Pose = std::array<std::array<double, 4>, 4>;

/// One file of several, with its pose.
struct PointInput {
  std::string path;
  bool posed = false;  ///< `pose` was given
  Pose pose{{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}}};
  bool seen_along_z = false;  ///< its scanner looked down its own z axis, as those of Stanford's scan lists do
};

/// The files that the names stand for, in order. A folder stands for every point file in it (by ending, sorted by name,
/// without subfolders), a name with * ? or [ that is not a file for the files that match, a Stanford scan list (.conf)
/// for its scans in their poses, and NAME@POSE.txt for any of these in the pose of the 4x4 matrix in POSE.txt (16
/// numbers, row by row). "-" stays itself. Throws Error(unreadable) naming what is missing, empty or malformed,
/// Error(usage) for an empty list.
std::vector<PointInput> expand_inputs(const std::vector<std::string>& names);

/// The same points in a pose: normals go by the inverse transpose, radii by the cube root of the change of volume, and
/// scanners move along. Where the source knows no scanner, its origin may have been one
/// (ScanPart::Scanner::pose_origin), or, with `seen_along_z`, it was far away on the source's z axis. Throws
/// Error(unreadable) for a pose that is singular or not finite.
std::unique_ptr<PointSource> pose_points(std::unique_ptr<PointSource> source, const Pose& pose,
                                         bool seen_along_z = false);

/// Several sources as one, rows in order. Attributes are united by name, in the widest type of any source (colours are
/// rescaled between 8 bits, 16 bits and 0-1); where a source lacks one it is 0, and a quality is 1. Normals and radii
/// stay only where every source has them; a remark names those that have none. Throws Error(usage) for an empty list.
std::unique_ptr<PointSource> join_points(std::vector<std::unique_ptr<PointSource>> sources);

/// expand_inputs(), open_points(), pose_points() and join_points() in one: all the points that the names stand for.
/// Throws as these do.
std::unique_ptr<PointSource> open_points(const std::vector<std::string>& names, const PointSettings& settings);

/// Of a source that is open already, what the settings select of it, projected where they say so.
std::unique_ptr<PointSource> open_points(std::unique_ptr<PointSource> source, const PointSettings& settings);

// Point files, written.

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
