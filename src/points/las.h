// What LAS and LAZ files hold (ASPRS, "LAS Specification", versions 1.0 to 1.4 R15): header and variable length
// records, the layout of point records, their values, and the chunks of LAZ.
#pragma once
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/number.h"
#include "lamina/attributes.h"
#include "lamina/points.h"
#include "laz/chunks.h"
#include "points/formats.h"
#include "points/input_file.h"
#include "points/point_columns.h"

namespace lamina {

/// How the points of a LAZ file are packed, by the record of LASzip.
struct LazPacking {
  static constexpr std::uint32_t kVariable = 0xFFFFFFFF;

  bool layered = false;            ///< formats 6 to 8
  bool chunked = true;             ///< else all points are one chunk, without a table
  std::uint32_t chunk_points = 0;  ///< in every chunk but the last; kVariable: the chunk table tells
  laz::RecordLayout layout;
};

/// By user and number of the record, in the list of variable length records.
inline constexpr const char* kLazUser = "laszip encoded";
inline constexpr std::uint16_t kLazRecord = 22204;

/// From the contents of the record, of points of the format and size. Throws Error(unreadable), beginning with `name`,
/// for what is not read: wave packets, coders of another kind, items that do not make such a point.
LazPacking parse_laz_packing(std::span<const std::byte> record, int point_format, std::size_t record_bytes,
                             const std::string& name);

/// The record, with its own header, for points of format 6 or 7 in chunks of `chunk_points`.
std::string laz_packing_record(int point_format, std::size_t record_bytes, std::uint32_t chunk_points);

// The public header block, and what variable length records say of coordinates, extra bytes and compression.

/// A value some program put behind the standard ones of every point.
struct LasExtra {
  std::string name;  ///< usual_name()
  ScalarType type = ScalarType::float32;
  std::size_t offset = 0;  ///< in the point record
  double scale = 1, shift = 0;
};

struct LasHeader {
  int minor = 0;         ///< version 1.minor
  int point_format = 0;  ///< 0 to 10
  std::size_t record_bytes = 0;
  std::uint64_t count = 0;
  std::uint64_t data = 0;       ///< offset of the first point
  std::uint64_t uncounted = 0;  ///< points for which there is room behind those that are counted
  std::array<double, 3> scale{}, offset{};
  std::array<double, 3> low{}, high{};  ///< bounding box as the header gives it
  bool geographic = false;              ///< x and y are degrees
  bool several_returns = false;         ///< some pulses have more than one, by the header's counts
  std::string crs;                      ///< PointSourceInfo::crs
  std::vector<LasExtra> extras;         ///< of one value each, of a type this library has
  std::optional<LazPacking> packing;    ///< of LAZ files
  std::vector<std::byte> octree;        ///< the record of a COPC file (parse_copc())
};

/// Throws Error(unreadable) for what no version allows: sizes too small, an unknown point format, a scale of 0, more
/// points than the file has room for; for a count of 0 before points, which a writer leaves that was stopped; and for
/// LAZ that is compressed in a way not known here.
LasHeader read_las_header(const InputFile& file);

/// Bytes of the standard values of a point format, 0 to 10.
std::size_t las_record_bytes(int point_format);
/// Offset of red in a record, 0 for formats without colours; green and blue follow, each of 16 bits.
std::size_t las_colour_offset(int point_format);

// What a point record of LAS holds between its intensity and its colours: returns, classes, angles, times.

struct LasField {
  std::string_view name;   ///< as an attribute
  ScalarType stored{};     ///< in the record
  std::size_t offset = 0;  ///< in the record, bytes
  unsigned shift = 0;      ///< where its bits begin
  unsigned bits = 0;       ///< how many; 0: all of `stored`
  double scale = 1;        ///< from the record to the attribute

  /// As a double that was read from the record's bytes stands for it.
  [[nodiscard]] double value(double stored_value) const {
    if (bits == 0) return stored_value * scale;
    return static_cast<double>(static_cast<unsigned>(stored_value) >> shift & ((1U << bits) - 1));
  }
  [[nodiscard]] bool is_stored_as_it_is() const { return bits == 0 && scale == 1; }
  /// Of the attribute.
  [[nodiscard]] ScalarType type() const { return scale == 1 ? stored : ScalarType::float32; }
};

/// Those of the point format, in the record's order. They are, by name: return_number, number_of_returns, class_flags
/// (1 synthetic, 2 key point, 4 withheld, 8 overlap), scanner_channel, scan_direction, edge_of_flight_line,
/// classification, user_data, scan_angle (degrees), point_source, gps_time.
std::vector<LasField> las_fields(int point_format);

/// Longest time of a week, seconds: larger ones are none of a week but adjusted GPS time.
inline constexpr double kSecondsOfWeek = 604800;

struct LasExtraColumn {
  std::string name;
  ScalarType type = ScalarType::float32;
};

/// What the header says of all points.
struct LasTotals {
  std::uint64_t rows = 0;
  std::array<LasAxis, 3> axes{};
  std::array<std::uint64_t, 15> by_return{};  ///< points that are a pulse's first return, second, ...
  bool adjusted_times = false;                ///< some GPS time is none of a week
};

class LasLayout {
 public:
  /// Throws Error(internal) for names that do not fit.
  explicit LasLayout(const PointColumns& columns);

  [[nodiscard]] bool has_colours() const { return colours_; }
  [[nodiscard]] int point_format() const { return colours_ ? 7 : 6; }
  [[nodiscard]] std::size_t record_bytes() const { return record_bytes_; }
  /// Header and records before the points; `packing` is LAZ's record, empty for LAS.
  [[nodiscard]] std::string header(const LasTotals& totals, const std::string& packing) const;
  /// Adds the batch's returns and times. Throws Error(usage) naming `file` and a value that a record has no room for.
  void count(const SampleBatch& batch, const std::string& file, LasTotals& totals) const;
  /// The coordinate system to name before the points: well-known text, or EPSG:NUMBER, which becomes GeoTIFF keys (of
  /// degrees where it is `geographic`). Anything else has no place there.
  void name_system(const std::string& crs, bool geographic);
  /// Rows [first, first + n) as point records.
  void encode(const SampleBatch& batch, const std::array<LasAxis, 3>& axes, std::size_t first, std::size_t n,
              std::byte* out) const;

 private:
  /// An attribute that has its own place in a record.
  struct OwnPlace {
    LasField field;
    std::size_t attribute = 0;
  };

  void put_fields(const SampleBatch& batch, std::size_t row, std::byte* record) const;

  PointColumns columns_;
  std::vector<OwnPlace> fields_;  ///< of las_fields()
  bool colours_ = false;
  std::array<std::size_t, 3> colour_{};  ///< attributes red, green, blue
  int intensity_ = -1;                   ///< its attribute, -1: none
  std::vector<std::size_t> others_;      ///< attributes that are extra bytes
  std::vector<LasExtraColumn> extras_;   ///< all extra bytes
  std::size_t record_bytes_ = 0;
  std::string system_;       ///< the record of the coordinate system
  bool system_text_ = true;  ///< which is text, as these point formats ask for; else keys, which others read as well
};

// Where the chunks of a LAZ file are, and those that are the nodes of a COPC file.

struct LazChunk {
  std::uint64_t offset = 0, bytes = 0;  ///< in the file
  std::uint64_t first = 0;              ///< row
  std::uint64_t points = 0;
};

struct LazChunks {
  std::vector<LazChunk> chunks;
  std::uint64_t uncounted = 0;  ///< points behind those that the header counts
  bool without_table = false;   ///< the chunk table is missing or damaged
};

/// By the chunk table, wherever it stands; where it is missing or makes no sense, one chunk after another, which for
/// formats 0 to 3 takes decoding them. Memory: 32 bytes a chunk. Throws Error(unreadable) where the chunks hold fewer
/// points than the header promises, and for one that unpacks to more than kMostChunkBytes.
LazChunks find_laz_chunks(const InputFile& file, const LasHeader& header);

/// Throws Error(unreadable) for more points than the chunk's bytes can hold, or more than are unpacked at once.
void require_sensible(const LazChunk& chunk, const InputFile& file, const LasHeader& header);

inline constexpr std::uint64_t kMostChunkBytes = std::uint64_t{512} << 20;

// COPC: LAZ whose chunks are the nodes of an octree, coarse ones before fine ones (copc.io, version 1.0). A node holds
// a part of the points in its cube, evenly spread; all nodes together hold all points.

/// By user and number of its record, in the list of variable length records.
inline constexpr const char* kCopcUser = "copc";
inline constexpr std::uint16_t kCopcRecord = 1;

struct CopcOctree {
  std::array<double, 3> centre{};
  double half_size = 0;                           ///< of the root's cube
  double spacing = 0;                             ///< between the points of the root; half of it in every further level
  std::uint64_t root_offset = 0, root_bytes = 0;  ///< of the first page of the list of nodes
};

/// From the contents of the record. Throws Error(unreadable), beginning with `name`.
CopcOctree parse_copc(std::span<const std::byte> record, const std::string& name);

/// The nodes that a selection asks for by resolution and box, in the order of the file. Throws Error(unreadable)
/// for a list of nodes that is damaged.
std::vector<LazChunk> find_copc_nodes(const InputFile& file, const CopcOctree& octree, const PointSelection& selection);

// The point records of a LAS file, whether they stand there as they are or compressed in chunks (LAZ).

/// From any thread.
class LasRecords {
 public:
  virtual ~LasRecords() = default;
  LasRecords(const LasRecords&) = delete;
  LasRecords& operator=(const LasRecords&) = delete;

  /// Hands the records of the rows over, in order and in pieces. Bytes that are not wanted may hold anything. Throws
  /// Error(unreadable) naming file and place.
  virtual void read(RowRange rows, const laz::WantedBytes& wanted, const TakeRows& take) const = 0;

  [[nodiscard]] std::uint64_t count() const { return count_; }
  /// What the user should know, one line each.
  [[nodiscard]] const std::vector<std::string>& remarks() const { return remarks_; }

 protected:
  LasRecords() = default;
  std::uint64_t count_ = 0;
  std::vector<std::string> remarks_;
};

/// All records, or of COPC those of the octree's nodes that the selection asks for. `file` and `header` must outlive
/// them. Throws Error(unreadable), and Error(usage) where the selection asks for nodes and there are none.
std::unique_ptr<LasRecords> open_las_records(const InputFile& file, const LasHeader& header,
                                             const PointSelection& selection);

}  // namespace lamina
