// What the columns of a point file are to us, and where their values go.
#pragma once
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "lamina/points.h"

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

}  // namespace lamina
