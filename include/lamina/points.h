// Point files, read in batches of rows: one implementation per format under src/points/.
#pragma once
#include <cstdint>
#include <memory>
#include <string>

#include "lamina/attributes.h"
#include "lamina/sample.h"

namespace lamina {

struct PointSourceInfo {
  std::string path;               ///< as given by the user, for messages
  std::uint64_t count = 0;        ///< rows the header promises
  bool has_normals = false;       ///< nx ny nz all present
  bool has_radius = false;        ///< radius, else pscale
  bool has_quality = false;       ///< quality, else confidence
  std::string radius_name;        ///< as the file calls it; empty: none
  std::string quality_name;       ///< as the file calls it; empty: none
  bool random_access = false;     ///< read() may be called for any row, from several threads
  bool double_precision = false;  ///< positions are declared float64
  AttributeLayout attributes;     ///< every other scalar property of the points, file order (colours keep their type)
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

/// Opens a point file by its content (PLY so far: ascii, binary little and big endian). "-" is standard input; pipes
/// are first spooled to an unlinked file in `tmp_dir` (empty: the system's temporary folder).
///
/// Properties of element `vertex`: x y z; nx ny nz; radius (else pscale); quality (else confidence); every other one is
/// an attribute, carried as float, integers of 32 bits and doubles in SampleBatch::exact as well. Positions in an ascii
/// file keep all their digits even where the header says float, as georeferenced ones need them. Binary files are
/// random_access and never mapped: resident memory does not grow with the file.
///
/// Throws Error(unreadable) naming the file and the place: missing file, directory, empty file, not a PLY, malformed
/// header, no vertex element, no x y z, an incomplete normal, a property named twice, a list among the vertex's
/// properties, a file shorter or longer than the header's counts promise (ascii: known when the last row is read).
/// Throws Error(budget) when `tmp_dir` cannot take the spooled input.
std::unique_ptr<PointSource> open_points(const std::string& path, const std::string& tmp_dir = {});

}  // namespace lamina
