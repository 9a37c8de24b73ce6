// How much of a cloud more than one of its scans saw.
#pragma once
#include <array>
#include <cstdint>
#include <limits>
#include <unordered_map>
#include <vector>

#include <Eigen/Core>

#include "base/hashing.h"
#include "lamina/points.h"

namespace lamina {

/// Counts in places, cubes of a hundredth of the cloud's diagonal. Memory: some 40 bytes a place, of which a surface
/// has ten thousand or a few.
class ScanOverlap {
 public:
  /// The box is that of the whole cloud, roughly.
  ScanOverlap(std::vector<ScanPart> scans, const Eigen::Vector3d& low, const Eigen::Vector3d& high);
  /// Rows in the source's order, from row batch.first on.
  void add(const SampleBatch& batch);
  /// The share of all places that several scans have samples in; 0 where there is one scan.
  [[nodiscard]] double share() const;

 private:
  static constexpr std::uint32_t kSeveral = std::numeric_limits<std::uint32_t>::max();
  struct Place {
    std::array<std::int32_t, 3> at;
    bool operator==(const Place&) const = default;
  };
  struct PlaceHash {
    std::size_t operator()(const Place& p) const { return cell_hash(p.at[0], p.at[1], p.at[2]); }
  };

  std::vector<ScanPart> scans_;
  Eigen::Vector3d low_;
  double inverse_ = 0;
  std::unordered_map<Place, std::uint32_t, PlaceHash> seen_by_;  ///< which scan, or kSeveral
};

}  // namespace lamina
