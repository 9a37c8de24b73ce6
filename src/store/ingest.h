// From the input's samples to the slab store: validated, rotated, fixed-point, bucketed along the sweep axis; for jobs
// that look at neighbours and come back to rows, with the id of each row, its place in the input (RowIdSource).
#pragma once
#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "base/hashing.h"
#include "lamina/frame.h"
#include "lamina/points.h"
#include "lamina/run.h"
#include "lattice/lattice.h"
#include "store/input_survey.h"
#include "store/slab_store.h"

namespace lamina {

/// How much of a cloud more than one of its scans saw. Counts in places, cubes of a hundredth of the cloud's diagonal.
/// Memory: some 40 bytes a place, of which a surface has ten thousand or a few.
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

struct Ingested {
  SlabStore store;
  Extent extent;
  Census census;         ///< of the rows read
  bool complete = true;  ///< false: a sample lies too far outside the box surveyed, and reading stopped there
  double overlap = 0;    ///< ScanOverlap::share()
};

/// Where a store's files go, and whether they have names and stay (StoreSettings::keep).
struct StorePlace {
  std::string directory;
  bool keep = false;
  StorePlace(std::string in, bool stays = false) : directory(std::move(in)), keep(stays) {}
};

/// Rows [first, end) of an input, as far as there are.
struct RowSpan {
  std::uint64_t first = 0, end = std::numeric_limits<std::uint64_t>::max();
};

struct IngestSettings {
  double radius_scale = 1;  ///< multiplies given radii
  RowPick pick{};
  RowSpan rows{};
};

/// Reads the input, or some of its rows, into the store; samples with a defect are left out. After a survey of all rows
/// the result is always complete; after one of a part it need not be.
Ingested ingest(PointSource& source, const Survey& survey, const Frame& frame, const StorePlace& place,
                const RunContext& run, const IngestSettings& settings = {});

/// What else the source has is left out. Rows without a usable normal, and all of them without `with_normals`, get
/// (0, 0, 1).
class RowIdSource final : public PointSource {
 public:
  static constexpr std::size_t kDigits = 3;  ///< of a row's id, 16 bits each: the store keeps them in two bytes

  explicit RowIdSource(PointSource& source, bool with_normals = true);
  void read(std::uint64_t first, std::size_t count, SampleBatch& out) override;

 private:
  PointSource& source_;
  bool with_normals_;
};

/// Row of sample i of the store, and whether its normal is the input's.
std::uint64_t row_of(const LocalSamples& samples, std::size_t i);
bool has_given_normal(const LocalSamples& samples, std::size_t i);

}  // namespace lamina
