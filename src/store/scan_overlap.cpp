#include "store/scan_overlap.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace lamina {
namespace {

/// Places across the cloud's diagonal.
constexpr double kPlacesAcross = 100;
/// Of many samples in a place a few tell who saw it.
constexpr std::size_t kStride = 8;

}  // namespace

ScanOverlap::ScanOverlap(std::vector<ScanPart> scans, const Eigen::Vector3d& low, const Eigen::Vector3d& high)
    : scans_(std::move(scans)), low_(low) {
  const double diagonal = (high - low).norm();
  inverse_ = diagonal > 0 ? kPlacesAcross / diagonal : 0;
}

void ScanOverlap::add(const SampleBatch& batch) {
  if (scans_.size() < 2) return;
  for (std::size_t i = 0; i < batch.size(); i += kStride) {
    const Eigen::Vector3d at = (Eigen::Vector3d(batch.x[i], batch.y[i], batch.z[i]) - low_) * inverse_;
    // Samples far outside of the box, and those that are not finite, are no place.
    if (!(at.cwiseAbs().maxCoeff() < 2 * kPlacesAcross)) continue;
    const auto next = std::upper_bound(scans_.begin(), scans_.end(), batch.first + i,
                                       [](std::uint64_t row, const ScanPart& scan) { return row < scan.first; });
    const auto scan = static_cast<std::uint32_t>(next - scans_.begin());
    const Place place{{static_cast<std::int32_t>(std::floor(at.x())), static_cast<std::int32_t>(std::floor(at.y())),
                       static_cast<std::int32_t>(std::floor(at.z()))}};
    const auto [known, is_new] = seen_by_.try_emplace(place, scan);
    if (!is_new && known->second != scan) known->second = kSeveral;
  }
}

double ScanOverlap::share() const {
  if (seen_by_.empty()) return 0;
  const auto several =
      std::count_if(seen_by_.begin(), seen_by_.end(), [](const auto& place) { return place.second == kSeveral; });
  return static_cast<double>(several) / static_cast<double>(seen_by_.size());
}

}  // namespace lamina
