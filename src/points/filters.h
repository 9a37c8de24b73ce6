// Sources made of others: points that somebody wants, other normals, degrees in metres.
#pragma once
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "lamina/points.h"
#include "points/point_columns.h"

namespace lamina {

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
