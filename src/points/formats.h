// The formats of point files: told by their first bytes, read and written; and sources made of others.
#pragma once
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/descriptor.h"
#include "base/output_file.h"
#include "lamina/points.h"
#include "points/input_file.h"
#include "points/point_columns.h"

namespace lamina {

enum class PointFormat { ply, obj, pcd, las, ptx, e57, vdb, text };

/// The format of a file that begins with `start` (a few kilobytes suffice, unless a long comment comes first); `name`
/// decides by its ending where the content does not. Throws Error(unreadable) for what is none of them, saying what it
/// looks like instead and what to do about it.
PointFormat detect_format(std::string_view start, const std::string& name);

/// A list of scans with their poses, as Stanford's come (camera, mesh and bmesh lines).
bool is_scan_list(std::string_view start);

/// Endings of the files that a folder is searched for, lower case with the dot; ".gz" may follow.
bool has_point_ending(std::string_view name);

// The readers of points, one for each format; all but VDB and ascii PLY read any rows from any thread.

/// PLY of any encoding. Throws Error(unreadable).
std::unique_ptr<PointSource> open_ply(InputFile file, const std::string& path);

/// The vertices of an OBJ file: `v x y z [w | r g b | r g b a]`, and `vn` where there are as many of them and the
/// faces, if any, give every vertex its own. Throws Error(unreadable).
std::unique_ptr<PointSource> open_obj(InputFile file, const std::string& path);

/// PCD: ascii, binary, and binary_compressed, which is unpacked to a temporary file first. Packed colours (rgb, rgba)
/// become red green blue [alpha] of 8 bits. Fields of several values and integers of 64 bits are left out. Throws
/// Error(unreadable), and Error(budget) when `tmp_dir` has no room.
std::unique_ptr<PointSource> open_pcd(InputFile file, const std::string& path, const std::string& tmp_dir);

/// LAS, and LAZ of point formats 0 to 3 and 6 to 8, whose chunks are decoded as they are wanted. Attributes: intensity,
/// red green blue and nir where any point has them other than 0, and extra bytes of one value. Colours that never
/// exceed 255 are 8-bit ones in 16 bits, which some programs write, and come as such. With PointSettings::all_fields
/// also what else a record has (las_fields()), where any point has it other than 0. Of the selection it sees to the
/// octree's nodes of a COPC file.
std::unique_ptr<PointSource> open_las(InputFile file, const std::string& path, const PointSettings& settings = {});

/// PTX (Leica Cyclone's text format), organised scans with their poses. Points of all scans in the common frame; places
/// of the grid without a return (0 0 0) are left out. Values after x y z: intensity, and red green blue of 8 bits.
/// Throws Error(unreadable).
std::unique_ptr<PointSource> open_ptx(InputFile file, const std::string& path);

/// E57: the scans of the file, each in its pose. Points marked as invalid are left out, images too. Throws
/// Error(unreadable), also for a page whose checksum is wrong unless these are ignored.
std::unique_ptr<PointSource> open_e57(InputFile file, const std::string& path, bool ignore_checksums);

/// Throws Error(usage) for PointSettings::columns that cannot be meant.
void require_columns(const std::string& columns);

/// XYZ, PTS, ASC, CSV, PWN and whatever else has a point's numbers on a line. Counts the rows; `columns` as in
/// PointSettings. Throws Error(unreadable) or Error(usage).
std::unique_ptr<PointSource> open_text(InputFile file, const std::string& path, const std::string& columns);

/// OpenVDB: the file's first points grid, whole in memory: OpenVDB reads no parts of one. Attributes of types without
/// numbers are named in a remark. Throws Error(unreadable).
std::unique_ptr<PointSource> open_vdb(const std::string& path);

// The writers of points, one for each format, and what they share.

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

/// Values of points that are none of their source's attributes: nobody carries them, but they may be selected by. What
/// sources are, too. From any thread.
class HiddenValues {
 public:
  virtual ~HiddenValues() = default;
  /// The names of las_fields().
  [[nodiscard]] virtual bool has_hidden(std::string_view name) const = 0;
  /// How many points are of each class; empty where they have none.
  [[nodiscard]] virtual std::vector<std::uint64_t> class_counts() const = 0;
  /// Those of the names, which it has, for the rows: an array for each.
  virtual void read_hidden(const std::vector<std::string>& names, RowRange rows,
                           std::vector<std::vector<double>>& values) const = 0;

 protected:
  HiddenValues() = default;
  HiddenValues(const HiddenValues&) = default;
  HiddenValues& operator=(const HiddenValues&) = default;
};

/// The points of the source that are selected; itself where that is all of them. Reads it once to count them, in
/// parallel where it is random_access, but not for classes that none of its points is of. A remark says how many are
/// left out. Memory: 8 bytes for 4096 rows. Throws Error(usage) for values that it does not have.
std::unique_ptr<PointSource> select_points(std::unique_ptr<PointSource> source, const PointSelection& selection);

/// The rows of a source with other normals than its own, which a derived class fills in.
class WithNormals : public PointSource {
 public:
  explicit WithNormals(std::unique_ptr<PointSource> source) : source_(std::move(source)) {
    info_ = source_->info();
    info_.found_normals = !info_.has_normals;
    info_.has_normals = true;
  }
  void read(std::uint64_t first, std::size_t count, SampleBatch& out) final {
    source_->read(first, count, out);
    out.first = first;
    give_normals(out);
  }

 protected:
  /// From any thread where the source may be read so.
  virtual void give_normals(SampleBatch& rows) const = 0;

 private:
  std::unique_ptr<PointSource> source_;
};

// Longitude and latitude to metres in a plane.

/// Whether a coordinate reference system (PointSourceInfo::crs) is known to be one of degrees.
bool names_degrees(const std::string& crs);

/// The same points in metres to the east and north of the whole degrees next to the first of them: transverse Mercator
/// on the ellipsoid that the coordinate system names, else that of WGS 84, true to scale along its middle. Heights
/// stay, and are taken for metres. Throws Error(usage) where the coordinates are known to be no degrees;
/// Error(unreadable) naming the row for what is no longitude and latitude or lies too far away for a plane, here or
/// when it is read.
std::unique_ptr<PointSource> project_degrees(std::unique_ptr<PointSource> source);

}  // namespace lamina
