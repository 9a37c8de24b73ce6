// Normals in the order of the rows, and the rows with them: what became of each row's normal, and, of
// organised scans, what the faces between neighbouring places of the grid say.
#pragma once
#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/spill_file.h"
#include "lamina/normals.h"
#include "lamina/points.h"
#include "lamina/run.h"
#include "normals/row_records.h"
#include "normals/sides.h"
#include "points/scans.h"

namespace lamina::normals {

class RowNormals {
 public:
  /// Gives the records' normals the signs of their patches. Rows without a record keep what the input has for them, or
  /// have none where it has none.
  RowNormals(RowRecords& records, const PatchSigns& signs, std::uint64_t rows, const std::string& directory,
             const RunContext& run);
  /// Sets the batch's normals. Safe from several threads.
  void apply(SampleBatch& batch) const;

 private:
  void write_file(RowRecords& records, const PatchSigns& signs, std::uint64_t rows, const RunContext& run);
  /// Of the rows from `first` on.
  void codes_of(std::uint64_t first, std::span<NormalCode> codes) const;

  std::vector<RowRecord> by_row_;  ///< where they fit into memory
  std::optional<SpillFile> file_;  ///< of codes, where they do not
};

/// The rows of a source with these normals.
std::unique_ptr<PointSource> give_normals(std::unique_ptr<PointSource> source, std::unique_ptr<RowNormals> normals);

/// The samples of one line of the grid; places without one are not finite.
using GridLine = std::vector<Eigen::Vector3d>;

class GridFaces {
 public:
  GridFaces(std::size_t length, const Viewpoint& scanner) : length_(length), scanner_(scanner) {}
  /// The next line, `length` places.
  void add(GridLine line);
  /// Normals of the line `kRing` lines before the last one added (0 0 0: none): final, as its faces are all there.
  /// Called after each add(); at the end add lines without samples.
  [[nodiscard]] std::vector<std::array<float, 3>> finished() const;
  static constexpr std::size_t kRing = 2;  ///< faces to either side that a normal is made of

 private:
  struct Face {
    Eigen::Vector3d normal{0, 0, 0};  ///< as long as twice the area; 0: none
    Eigen::Vector3d centre{0, 0, 0};
  };
  [[nodiscard]] Face face(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c) const;
  [[nodiscard]] Face quad(const GridLine& low, const GridLine& high, std::size_t at) const;
  [[nodiscard]] std::array<float, 3> normal_at(std::size_t at) const;

  std::size_t length_;
  Viewpoint scanner_;
  std::deque<GridLine> lines_;            ///< the last 2 kRing + 1
  std::deque<std::vector<Face>> strips_;  ///< between them
};

struct GridNormals {
  std::unique_ptr<PointSource> source;  ///< the same rows; those without a normal have 0 0 0
  std::uint64_t found = 0;
};

/// A sample's normal is the sum of the faces around it (and of the next ring's where these are near its plane), so it
/// lies on the side the scanner saw. Faces that the scanner would have seen at more than 80 degrees join a thing to
/// what stands behind it and do not count; a sample with fewer than three of its four faces gets no normal. `seen` says
/// where the scanners stood, row by row (ascending); grids that it does not know the scanner of get no normals either.
///
/// Reads the source once; memory: a few lines of a grid, and a bit for each of its places. Normals rest in an unnamed
/// file in `directory`, 12 bytes a row. Throws Error(budget) when it cannot be written, and what the source throws.
GridNormals grid_normals(std::unique_ptr<PointSource> source, const std::vector<PlacedGrid>& grids,
                         const std::vector<SeenFrom>& seen, const std::string& directory, const RunContext& run);

}  // namespace lamina::normals
