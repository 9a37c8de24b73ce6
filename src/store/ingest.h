// A first look at the input: what is usable, where it lies, and the frame to compute in. Then its samples on their way
// to the slab store: validated, rotated, fixed-point, bucketed along the sweep axis; for jobs that look at neighbours
// and come back to rows, with the id of each row, its place in the input (RowIdSource).
#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "base/hashing.h"
#include "lamina/edit.h"
#include "lamina/frame.h"
#include "lamina/points.h"
#include "lamina/run.h"
#include "lattice/lattice.h"
#include "store/slab_store.h"

namespace lamina {

/// Whether a row is taken from the input at all.
enum class Pick : std::uint8_t { taken, skipped, clipped };
/// Of row i of a batch, which is the input's row `row`.
Pick judge(const RowPick& pick, const SampleBatch& batch, std::size_t i, std::uint64_t row);

/// Why a sample cannot be used.
enum class Defect : std::uint8_t { none, position, normal, radius, quality };
inline constexpr int kDefects = 5;
/// Why samples of the source with this defect are left out.
const char* reason_of(Defect defect, const PointSourceInfo& source);
/// The defect of sample i of a batch.
Defect defect_of(const SampleBatch& batch, std::size_t i);

/// Squared length that a normal must have to tell a direction.
inline constexpr double kLeastNormalSquared = 1e-24;

/// Largest attribute value a run takes: weighted sums of greater ones would overflow float.
inline constexpr float kLargestAttribute = 1e18F;
/// An attribute's value as a run takes it: NaN (what other programs write for "no value") is 0.
inline float usable_attribute(float value) {
  return value == value ? std::clamp(value, -kLargestAttribute, kLargestAttribute) : 0.0F;
}

/// What a pass over the input finds besides the samples themselves.
struct Census {
  std::uint64_t usable = 0;
  std::uint64_t clipped = 0, skipped = 0;  ///< rows that RowPick does not take
  std::array<std::uint64_t, kDefects> rejected{};
  std::array<std::uint64_t, kDefects> first_row{};
  Eigen::Vector3d low = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity());  ///< bounding box, input
  Eigen::Vector3d high = -low;                                                               ///< coordinates
  float max_quality = 0;                       ///< where the input gives quality
  std::uint64_t unusable_attributes = 0;       ///< values that usable_attribute() changes
  std::uint64_t first_unusable_attribute = 0;  ///< row of the first

  void reject(Defect defect, std::uint64_t row);
  /// Whether the row is taken; counts it where it is not.
  bool takes(const RowPick& pick, const SampleBatch& batch, std::size_t i);
  void count_attributes(const SampleBatch& batch, const AttributeLayout& layout);
  void merge(const Census& later);  ///< of the rows after those of this one
};

/// Of all rows: what the frame is chosen by. (What the samples say of the surface, a survey of the store finds:
/// samples/sampling_survey.h.)
struct Survey : Census {
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
};

/// Reads the whole input once. Throws as judge() does.
Survey survey_input(PointSource& source, BadSamples bad, const RunContext& run, const RowPick& pick = {});

/// A survey of some 2^18 rows from all over a large input whose rows can be read in any order: enough to choose a frame
/// by, though samples may lie outside its box; `usable` is an estimate for all rows. Nothing for other inputs, and
/// where the rows looked at make no frame.
std::optional<Survey> survey_part(PointSource& source, const RowPick& pick = {});

/// Warns of rows left out and attributes replaced. Throws Error(empty) when nothing usable is there or all samples lie
/// at one place, Error(unreadable) for a defect or an unusable attribute when `bad` is refuse, and for coordinates that
/// span too much.
void judge(const Census& census, const PointSourceInfo& source, BadSamples bad, const RunContext& run);

/// Throws Error(unreadable) when the source has no normals, Error(empty) when it promises no rows.
void require_samples(const PointSourceInfo& source);

/// Frame with the sweep axis last; fixed-point coordinates of the box surveyed stay within +-2^29.
Frame choose_frame(const Survey& survey, FrameMode mode);

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

/// Buckets for so many samples, along the frame's z, and the memory they wait in for the disk.
StoreSettings store_settings(const Survey& survey, const Frame& frame, const StorePlace& place);

/// Reads the input, or some of its rows, into the store; samples with a defect are left out. After a survey of all rows
/// the result is always complete; after one of a part it need not be.
Ingested ingest(PointSource& source, const Survey& survey, const Frame& frame, const StorePlace& place,
                const RunContext& run, const IngestSettings& settings = {});

/// Ids are attributes: as many digits of 16 bits, which the store keeps in two bytes each, as the last row takes. What
/// else the source has is left out. Rows without a usable normal, and all of them without `with_normals`, get
/// (0, 0, 1).
class RowIdSource final : public PointSource {
 public:
  explicit RowIdSource(PointSource& source, bool with_normals = true);
  void read(std::uint64_t first, std::size_t count, SampleBatch& out) override;

 private:
  PointSource& source_;
  bool with_normals_;
};

/// Row of sample i of the store, and whether its normal is the input's.
std::uint64_t row_of(const LocalSamples& samples, std::size_t i);
bool has_given_normal(const LocalSamples& samples, std::size_t i);

/// Makes an extent hold another, too.
void widen(Extent& b, const Extent& by);

}  // namespace lamina
