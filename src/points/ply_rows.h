// What the properties of a PLY's vertices are to us, and where their values go.
#pragma once
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "lamina/points.h"
#include "points/ply_header.h"

namespace lamina {

enum class Role { x, y, z, nx, ny, nz, radius, quality, attribute };

struct PlyColumn {
  std::string name;
  ScalarType type = ScalarType::float32;
  std::size_t offset = 0;  ///< in a row of a binary file, bytes
  Role role = Role::attribute;
  std::size_t attribute = 0;  ///< Role::attribute: index into the layout
};

/// The vertex element, understood.
struct PlyRows {
  std::size_t element = 0;         ///< its index in the header
  std::vector<PlyColumn> columns;  ///< file order
  std::size_t stride = 0;          ///< bytes of a row in a binary file
  PointSourceInfo info;            ///< all but random_access
};

/// Finds the vertex element and gives its properties their roles. `path` is the user's, `name` the one for messages.
/// Throws Error(unreadable) when there is none, no x y z, an incomplete normal, a property twice or a list.
PlyRows understand_vertices(const PlyHeader& header, const std::string& path, const std::string& name);

/// The array a column is read into; exactly one is set.
struct ColumnTarget {
  double* wide = nullptr;
  float* narrow = nullptr;
};

/// Sizes the batch for rows [first, first + count) and gives each column its array, in the columns' order.
std::vector<ColumnTarget> prepare_batch(const PlyRows& rows, std::uint64_t first, std::size_t count,
                                        SampleBatch& batch);

/// Once the rows are read: the floats of the attributes that were read as doubles.
void round_exact_attributes(SampleBatch& batch);

/// "N rows are promised, M are there", worded the same for all formats.
[[noreturn]] void report_short_file(const std::string& name, const std::string& element, std::uint64_t promised,
                                    const std::string& held);

}  // namespace lamina
