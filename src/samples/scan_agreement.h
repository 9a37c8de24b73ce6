// How scans of one cloud lie to each other, and the small rigid motions after which they agree: every scan's mean
// position and normal at the same few places, and the least squares of their distances.
#pragma once
#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <unordered_map>
#include <vector>

#include "base/hashing.h"

namespace lamina {

/// Samples of all scans together about a place whose scans are compared.
inline constexpr double kCompared = 64;

/// Of those, a scan must have so many for its mean to be compared.
inline constexpr std::uint32_t kLeastCompared = 5;

/// Two means are compared only where they lie beside each other by less than this, in radii of the place: at the rim of
/// a scan they tell of different parts of the surface.
inline constexpr double kBesideEachOther = 0.4;

/// Length of the mean normal of a scan's samples at a place from which on they tell of one sheet, and the least cosine
/// between two scans' means.
inline constexpr double kOneSheet = 0.9;
inline constexpr double kSameSheet = 0.8;

/// Distances count by Tukey's weights up to so many deviations.
inline constexpr double kFarOff = 4;

/// x becomes turn x + shift.
struct RigidMotion {
  Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();
  [[nodiscard]] Eigen::Vector3d operator()(const Eigen::Vector3d& at) const { return turn * at + shift; }
};

struct OrientedPoint {
  Eigen::Vector3d at, normal;
};

/// Distances of pairs of scans along the surface's normal, input units: medians at all places where two scans can be
/// compared, as they are and after the motions.
struct Agreement {
  std::size_t places = 0;
  double before = 0, after = 0;
  std::vector<RigidMotion> motions;  ///< one a scan, in coordinates relative to the middle of the places
};

/// Takes one pass over the samples. Its answers depend on the order of the samples.
class ScanAgreement {
 public:
  /// `places` are samples spread over a cloud of `samples` in all, which give the places their radii.
  ScanAgreement(std::span<const OrientedPoint> places, double samples, std::size_t scans);
  ScanAgreement(const ScanAgreement&) = delete;
  ScanAgreement& operator=(const ScanAgreement&) = delete;

  /// About the middle of the places all rotations are.
  [[nodiscard]] const Eigen::Vector3d& middle() const { return middle_; }
  /// Median radius of the places.
  [[nodiscard]] double radius() const { return radius_; }
  /// A sample of a scan, relative to the middle.
  void add(const OrientedPoint& sample, std::size_t scan);
  [[nodiscard]] Agreement solve() const;

 private:
  struct ScanSums {
    std::uint32_t scan = 0, count = 0;
    double weight = 0;
    Eigen::Vector3d at = Eigen::Vector3d::Zero(), normal = Eigen::Vector3d::Zero();
  };
  struct Place {
    Eigen::Vector3d at, normal;
    double radius = 0;
    std::vector<ScanSums> scans;
  };
  struct Pair;
  struct Cell {
    std::int64_t x, y, z;
    bool operator==(const Cell&) const = default;
  };
  struct CellHash {
    std::size_t operator()(const Cell& c) const { return cell_hash(c.x, c.y, c.z); }
  };

  void choose_radii(double samples);
  void fill_cells();
  [[nodiscard]] std::vector<Pair> pairs() const;
  [[nodiscard]] Eigen::VectorXd least_squares(const std::vector<Pair>& pairs, const std::vector<double>& rest) const;

  std::vector<Place> places_;
  std::size_t scans_;
  Eigen::Vector3d middle_ = Eigen::Vector3d::Zero();
  double spread_ = 1;  ///< root mean square distance of the places from the middle: makes rotations lengths
  double radius_ = 0;
  double inverse_cell_ = 1;
  std::unordered_map<Cell, std::vector<std::uint32_t>, CellHash> cells_;  ///< places that reach into each
  static constexpr std::int64_t kNowhere = std::numeric_limits<std::int64_t>::min();
  Cell last_cell_{kNowhere, kNowhere, kNowhere};          ///< of the last sample
  const std::vector<std::uint32_t>* reaching_ = nullptr;  ///< the places of that, if any
};

}  // namespace lamina
