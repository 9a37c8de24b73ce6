// What the columns of a point file are to us, and where their values go.
#pragma once
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "lamina/attributes.h"
#include "lamina/points.h"
#include "points/input_file.h"

namespace lamina {

enum class Role { x, y, z, nx, ny, nz, radius, quality, attribute, skipped };

struct PointColumn {
  std::string name;
  ScalarType type = ScalarType::float32;
  std::size_t offset = 0;  ///< in a row of a binary file, bytes
  Role role = Role::attribute;
  std::size_t attribute = 0;  ///< Role::attribute: index into the layout
};

/// Gives every column its role by its name, but those already Role::skipped, and fills in `info`: has_normals,
/// has_radius, has_quality, double_precision, attributes. `noun` is what the format calls a column, for messages.
/// Throws Error(unreadable) when x, y or z is missing, the normal incomplete, or a name there twice.
void give_roles(std::vector<PointColumn>& columns, PointSourceInfo& info, const std::string& file,
                std::string_view noun);

/// Positions, normals and colours that are there by other names only (`normal_x normal_y normal_z`) get the usual ones.
void use_usual_names(std::vector<PointColumn>& columns);

/// Whether one of the columns has the name.
bool has_column(const std::vector<PointColumn>& columns, std::string_view name);

/// The name this library knows a column by, whatever program named it: lower case, without quotes; `r` and
/// `diffuse_red` are red, `normal_x` and `NormalX` nx, `i` and `scalar_intensity` intensity, and so on.
std::string usual_name(std::string_view name);

/// The usual names of a line's words if x, y and z are among them, and otherwise none. Where nothing is called x, y and
/// z, `easting northing elevation`, `P.x P.y P.z` and `Points:0 Points:1 Points:2` are.
std::vector<std::string> names_with_positions(const std::vector<std::string_view>& words);

/// Rows [first, first + count).
struct RowRange {
  std::uint64_t first = 0;
  std::size_t count = 0;
};
/// Those of the asked for that the source has.
RowRange rows_there(const PointSourceInfo& info, std::uint64_t first, std::size_t count);

/// The array a column is read into; at most one is set.
struct ColumnTarget {
  double* wide = nullptr;
  float* narrow = nullptr;
};

/// Sizes the batch for the rows and gives each column its array, in the columns' order.
std::vector<ColumnTarget> prepare_batch(const PointSourceInfo& info, const std::vector<PointColumn>& columns,
                                        RowRange rows, SampleBatch& batch);

/// Once the rows are read: the floats of the attributes that were read as doubles.
void round_exact_attributes(SampleBatch& batch);

/// Calls use(values of one, values of the other) for each column of two batches; the other gets as many attributes.
template <class From, class Use>
void for_columns(From& from, SampleBatch& to, const Use& use) {
  for (const auto axis : {&SampleBatch::x, &SampleBatch::y, &SampleBatch::z}) use(from.*axis, to.*axis);
  for (const auto column :
       {&SampleBatch::nx, &SampleBatch::ny, &SampleBatch::nz, &SampleBatch::radius, &SampleBatch::quality})
    use(from.*column, to.*column);
  to.attributes.resize(from.attributes.size());
  for (std::size_t a = 0; a < from.attributes.size(); ++a) use(from.attributes[a], to.attributes[a]);
  to.exact.resize(from.exact.size());
  for (std::size_t a = 0; a < from.exact.size(); ++a) use(from.exact[a], to.exact[a]);
}

// Rows of points as bytes of fixed size: read a block at a time and taken apart column by column, and written.

/// out[i] = the value of `type` at row + i * stride, for i < count. `swapped`: bytes stand in the other order than this
/// machine's.
template <class Out>
void convert_column(ScalarType type, bool swapped, const std::byte* row, std::size_t stride, std::size_t count,
                    Out* out);

extern template void convert_column(ScalarType, bool, const std::byte*, std::size_t, std::size_t, float*);
extern template void convert_column(ScalarType, bool, const std::byte*, std::size_t, std::size_t, double*);

/// Where rows lie in a file.
struct BinaryRows {
  std::uint64_t data = 0;  ///< offset of row 0
  std::size_t stride = 0;  ///< bytes of a row
  bool swapped = false;    ///< the other byte order than this machine's
};

/// Called with rows `bytes` on: `count` of them, which are those from `at` on of a range.
using TakeRows = std::function<void(const std::byte* bytes, std::size_t at, std::size_t count)>;

/// Hands the rows of the range over, in order and a block at a time. From any thread.
/// Throws Error(unreadable) when the file has become shorter since it was opened.
void read_row_blocks(const InputFile& file, const BinaryRows& rows, RowRange range, const TakeRows& take);

/// Takes `count` rows apart: their values go to the targets' places from `at` on.
void convert_rows(const BinaryRows& layout, const std::vector<PointColumn>& columns, const std::byte* bytes,
                  std::size_t at, std::size_t count, const std::vector<ColumnTarget>& targets);

/// Fills the targets with the rows of the range. From any thread.
/// Throws Error(unreadable) when the file has become shorter since it was opened.
void read_binary_rows(const InputFile& file, const BinaryRows& rows, const std::vector<PointColumn>& columns,
                      RowRange range, const std::vector<ColumnTarget>& targets);

/// Rows as bytes and back: x y z, nx ny nz, radius, quality, attributes, each in its own type, little-endian, without
/// gaps.
class RowCodec {
 public:
  explicit RowCodec(const PointColumns& columns);
  [[nodiscard]] std::size_t row_bytes() const { return row_bytes_; }

  /// Throws Error(internal) when an array the columns need is missing or shorter than the batch, or a number is not
  /// finite in the type it is written as; `first` is the number of the batch's first row and `name` the file's, for the
  /// message.
  void require_writable(const SampleBatch& batch, std::uint64_t first, const std::string& name) const;
  /// Writes rows [first, first + count) of a batch that is writable. Floats are rounded to integers and clamped.
  void encode(const SampleBatch& batch, std::size_t first, std::size_t count, std::byte* out) const;
  /// The batch of `count` rows that stand `stride` bytes apart.
  void decode(const std::byte* rows, std::size_t stride, std::size_t count, SampleBatch& out) const;

 private:
  PointColumns columns_;
  std::size_t row_bytes_ = 0;
};

}  // namespace lamina
