// Point files, read in batches of rows: one implementation per format under src/points/. docs/formats.md describes the
// formats for users.
#pragma once
#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "lamina/attributes.h"
#include "lamina/sample.h"

namespace lamina {

/// Rows from `first` on, up to the next part's, were measured together.
struct ScanPart {
  enum class Scanner : std::uint8_t {
    unknown,
    position,     ///< it stood at `at`
    direction,    ///< it stood far away in this direction
    pose_origin,  ///< `at` is where the pose puts the file's origin: there may have been the scanner
  };
  std::uint64_t first = 0;
  Scanner scanner = Scanner::unknown;
  std::array<double, 3> at{};  ///< input coordinates
};

struct PointSourceInfo {
  std::string path;               ///< as given by the user, for messages
  std::uint64_t count = 0;        ///< rows read() gives
  bool has_normals = false;       ///< nx ny nz all present
  bool has_radius = false;        ///< radius, else pscale
  bool has_quality = false;       ///< quality, else confidence
  std::string radius_name;        ///< as the file calls it; empty: none
  std::string quality_name;       ///< as the file calls it; empty: none
  bool random_access = false;     ///< read() may be called for any row, from several threads
  bool double_precision = false;  ///< positions need more than float32
  bool geographic = false;        ///< x and y are degrees of longitude and latitude: no job can measure in them
  std::vector<ScanPart> scans;    ///< ascending, the first begins with row 0; empty: one part, nothing known
  AttributeLayout attributes;     ///< every other scalar property of the points, file order (colours keep their type)
  std::vector<std::string> remarks;  ///< what the user should know: guesses, things left out; one line each
};

class PointSource {
 public:
  virtual ~PointSource() = default;
  PointSource(const PointSource&) = delete;
  PointSource& operator=(const PointSource&) = delete;
  [[nodiscard]] const PointSourceInfo& info() const { return info_; }

  /// Reads rows [first, first + count) clipped to info().count into `out` (resized, arrays reused). Values come as they
  /// stand in the file: non-finite coordinates are the caller's to judge. Sequential sources (random_access == false)
  /// want first == the row after the last one read, or 0 to start over.
  /// Throws Error(unreadable) naming file, row or line, and what is wrong.
  virtual void read(std::uint64_t first, std::size_t count, SampleBatch& out) = 0;

 protected:
  PointSource() = default;
  PointSourceInfo info_;
};

struct PointSettings {
  std::string tmp_dir;  ///< for what must be spooled or unpacked; empty: the system's temporary folder
  /// What the columns of text files (XYZ, CSV, ...) hold: names separated by commas, as in "x,y,z,red,green,blue,-".
  /// `-` skips a column; NAME:TYPE with a PLY type fixes the type (red:ushort). Empty: by the file's header line, else
  /// guessed from the numbers. Other formats ignore it.
  std::string columns;
};

/// Opens a point file by its content, and by its ending where the content leaves open what it is. "-" is standard
/// input; pipes are first spooled to an unlinked file in `tmp_dir`, and gzip is unpacked to one. docs/formats.md lists
/// the formats: PLY (also with a range grid), OBJ, XYZ and its kin, PTX, PCD, LAS, OpenVDB points (whole in memory).
///
/// PLY, properties of element `vertex`: x y z; nx ny nz; radius (else pscale); quality (else confidence); every other
/// one is an attribute, carried as float, integers of 32 bits and doubles in SampleBatch::exact as well. Positions in
/// an ascii file keep all their digits even where the header says float, as georeferenced ones need them. Binary files
/// and those of lines are random_access (ascii PLY is not) and never mapped: resident memory does not grow with the
/// file.
///
/// Throws Error(unreadable) naming the file and the place: missing file, directory, empty file, unknown format,
/// malformed header, no points, no x y z, an incomplete normal, a column named twice, a list among a PLY vertex's
/// properties, a file shorter or longer than its header's counts promise (ascii: known when the last row is read).
/// Throws Error(budget) when `tmp_dir` cannot take what is spooled, Error(usage) for columns that cannot be meant.
std::unique_ptr<PointSource> open_points(const std::string& path, const PointSettings& settings);
std::unique_ptr<PointSource> open_points(const std::string& path, const std::string& tmp_dir = {});

/// Affine, row by row: p' = M p, the last row 0 0 0 1.
using Pose = std::array<std::array<double, 4>, 4>;

struct PointInput {
  std::string path;
  bool posed = false;
  Pose pose{{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}}};
  bool seen_along_z = false;  ///< its scanner looked down its own z axis, as those of Stanford's scan lists do
};

/// What the user named, as files in order: a folder is every point file in it (by ending, sorted by name, not its
/// subfolders), a name with * ? or [ that is no file is a pattern, a Stanford scan list (.conf) is the scans it names
/// with their poses, and FILE@POSE.txt is a file with the 4x4 matrix in POSE.txt (16 numbers, row by row), which also
/// goes with folders, patterns and lists. "-" stays itself.
/// Throws Error(unreadable) naming what is missing, empty or malformed, Error(usage) for an empty list.
std::vector<PointInput> expand_inputs(const std::vector<std::string>& names);

/// The same points in a pose: normals by the inverse transpose, radii by the cube root of the volume change, scanners
/// moved along. Where nothing is known of these, the origin may have been one, or with `seen_along_z` one was far away
/// on the source's z axis.
/// Throws Error(unreadable) for a pose that is singular or not finite.
std::unique_ptr<PointSource> pose_points(std::unique_ptr<PointSource> source, const Pose& pose,
                                         bool seen_along_z = false);

/// Several sources as one, rows in order. Attributes are the union by name, in the widest type that a source has
/// (colours are rescaled between 8 bits, 16 bits and 0-1); what a source lacks is 0, quality 1. Normals and radii must
/// be everybody's, else they are nobody's and a remark says whose are missing.
std::unique_ptr<PointSource> join_points(std::vector<std::unique_ptr<PointSource>> sources);

/// All of the above: one stream of all that the names stand for.
std::unique_ptr<PointSource> open_points(const std::vector<std::string>& names, const PointSettings& settings);

}  // namespace lamina
