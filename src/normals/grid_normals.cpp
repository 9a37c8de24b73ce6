#include "normals/grid_normals.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

#include "base/spill_file.h"
#include "lamina/error.h"
#include "normals/grid_faces.h"

namespace lamina::normals {
namespace {

using Normal = std::array<float, 3>;
constexpr std::size_t kPiece = std::size_t{1} << 15;  ///< rows

/// The source's rows with the normals of a file that holds one for each.
class WithGridNormals final : public PointSource {
 public:
  WithGridNormals(std::unique_ptr<PointSource> source, SpillFile file)
      : source_(std::move(source)), file_(std::move(file)) {
    info_ = source_->info();
    info_.has_normals = true;
  }
  void read(std::uint64_t first, std::size_t count, SampleBatch& out) override {
    source_->read(first, count, out);
    std::vector<Normal> normals(out.size());
    file_.read(out.first * sizeof(Normal), std::as_writable_bytes(std::span(normals)));
    for (auto* axis : {&out.nx, &out.ny, &out.nz}) axis->resize(out.size());
    for (std::size_t i = 0; i < normals.size(); ++i) {
      out.nx[i] = normals[i][0];
      out.ny[i] = normals[i][1];
      out.nz[i] = normals[i][2];
    }
  }

 private:
  std::unique_ptr<PointSource> source_;
  SpillFile file_;
};

/// The source's rows one by one, in order.
class Rows {
 public:
  Rows(PointSource& source, const RunContext& run) : source_(source), run_(run) {}
  Eigen::Vector3d next() {
    if (at_ == batch_.size()) {
      if (run_.cancelled()) throw Error(ExitCode::internal, "cancelled");
      source_.read(row_, kPiece, batch_);
      at_ = 0;
      if (run_.progress) run_.progress({"grid normals", row_, source_.info().count, 0, 0});
      if (batch_.size() == 0) throw Error(ExitCode::internal, "grid normals: the source ends too early");
    }
    ++row_;
    const std::size_t i = at_++;
    return {batch_.x[i], batch_.y[i], batch_.z[i]};
  }
  [[nodiscard]] std::uint64_t row() const { return row_; }

 private:
  PointSource& source_;
  const RunContext& run_;
  SampleBatch batch_;
  std::size_t at_ = 0;
  std::uint64_t row_ = 0;
};

class GridJob {
 public:
  GridJob(PointSource& source, const std::string& directory, const RunContext& run)
      : rows_(source, run), file_(directory) {}

  void skip_to(std::uint64_t row) {
    for (; rows_.row() < row; rows_.next()) put({});
  }

  void take(const ScanGrid& grid, const Viewpoint& scanner) {
    constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
    const auto length = static_cast<std::size_t>(grid.length());
    GridFaces faces(length, scanner);
    const std::uint64_t lines = grid.lines();
    for (std::uint64_t l = 0; l < lines + GridFaces::kRing; ++l) {
      GridLine line(length, {kNone, kNone, kNone});
      for (std::size_t at = 0; l < lines && at < length; ++at) {
        if (grid.has(l, at)) line[at] = rows_.next();
      }
      faces.add(std::move(line));
      if (l < GridFaces::kRing) continue;
      const std::vector<Normal> normals = faces.finished();
      for (std::size_t at = 0; at < length; ++at) {
        if (grid.has(l - GridFaces::kRing, at)) put(normals[at]);
      }
    }
  }

  SpillFile finish(std::uint64_t& found) {
    file_.flush();
    found = found_;
    return std::move(file_);
  }

 private:
  void put(const Normal& n) {
    file_.append(std::as_bytes(std::span(n)));
    if (n != Normal{}) ++found_;
  }

  Rows rows_;
  SpillFile file_;
  std::uint64_t found_ = 0;
};

const SeenFrom* scanner_of(const std::vector<SeenFrom>& seen, std::uint64_t row) {
  const auto after =
      std::upper_bound(seen.begin(), seen.end(), row, [](std::uint64_t r, const SeenFrom& s) { return r < s.first; });
  return after != seen.begin() && std::prev(after)->known ? &*std::prev(after) : nullptr;
}

}  // namespace

GridNormals grid_normals(std::unique_ptr<PointSource> source, const std::vector<PlacedGrid>& grids,
                         const std::vector<SeenFrom>& seen, const std::string& directory, const RunContext& run) {
  GridJob job(*source, directory, run);
  for (const PlacedGrid& placed : grids) {
    const SeenFrom* const from = scanner_of(seen, placed.first);
    if (from == nullptr) continue;
    job.skip_to(placed.first);
    job.take(*placed.grid, from->viewpoint);
  }
  job.skip_to(source->info().count);
  GridNormals out;
  SpillFile file = job.finish(out.found);
  out.source = std::make_unique<WithGridNormals>(std::move(source), std::move(file));
  return out;
}

}  // namespace lamina::normals
