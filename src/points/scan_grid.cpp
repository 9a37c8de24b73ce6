#include "points/scan_grid.h"

#include <utility>

namespace lamina {
namespace {

class OneGrid final : public PointSource, public OrganisedPoints {
 public:
  OneGrid(std::unique_ptr<PointSource> source, std::shared_ptr<const ScanGrid> grid)
      : source_(std::move(source)), grid_(std::move(grid)) {
    info_ = source_->info();
  }
  void read(std::uint64_t first, std::size_t count, SampleBatch& out) override { source_->read(first, count, out); }
  [[nodiscard]] std::vector<PlacedGrid> grids() const override { return {{0, grid_}}; }

 private:
  std::unique_ptr<PointSource> source_;
  std::shared_ptr<const ScanGrid> grid_;
};

}  // namespace

void ScanGrid::add(bool filled) {
  filled_.push_back(filled);
  if (filled) ++rows_;
}

std::unique_ptr<PointSource> organised_points(std::unique_ptr<PointSource> source,
                                              std::shared_ptr<const ScanGrid> grid) {
  return std::make_unique<OneGrid>(std::move(source), std::move(grid));
}

std::vector<PlacedGrid> grids_of(const PointSource& source) {
  const auto* organised = dynamic_cast<const OrganisedPoints*>(&source);
  return organised != nullptr ? organised->grids() : std::vector<PlacedGrid>{};
}

}  // namespace lamina
