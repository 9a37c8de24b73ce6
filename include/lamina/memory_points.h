// Points that another program holds in its arrays, or hands over batch by batch: sources like files.
#pragma once
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "lamina/attributes.h"
#include "lamina/points.h"

namespace lamina {

/// A column of values in somebody's memory, one every `stride` bytes, which may be negative; of any alignment.
struct ArrayColumn {
  std::string name;  ///< as of a PLY's property: x y z; nx ny nz; radius or pscale; quality or confidence; else an
                     ///< attribute
  ScalarType type = ScalarType::float32;
  const void* data = nullptr;  ///< of the first row
  std::ptrdiff_t stride = 0;
};

/// A source of `count` rows that lie in these columns; nothing is copied but the batch that is read. It is
/// random_access. The arrays must stay as they are until it is destroyed. `name` stands for the file in messages.
/// Throws Error(unreadable) when x, y or z is missing, a normal incomplete, or a name there twice.
std::unique_ptr<PointSource> view_points(const std::string& name, std::uint64_t count,
                                         std::vector<ArrayColumn> columns);

/// Points that come batch by batch, their number unknown before: they wait in an unnamed file. One thread at a time.
class PointSpool {
 public:
  /// `name` stands for the file in messages, `columns` say what every batch has. tmp_dir: empty for the system's.
  /// Throws Error(budget) when there is no room for a file.
  PointSpool(std::string name, PointColumns columns, const std::string& tmp_dir = {});
  ~PointSpool();
  PointSpool(const PointSpool&) = delete;
  PointSpool& operator=(const PointSpool&) = delete;

  /// Adds the batch's rows, which have the arrays of the columns, attributes in their order. Values may be NaN or
  /// infinite; integers are rounded and clamped to their type. Throws Error(internal) when an array is missing,
  /// Error(budget) when the disk is full.
  void append(const SampleBatch& batch);
  [[nodiscard]] std::uint64_t rows() const;

  /// All rows, as a random_access source; nothing can be appended any more. Once.
  std::unique_ptr<PointSource> finish();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace lamina
