// A first pass over the input: what is usable, where it lies, and the frame to compute in.
#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <optional>

#include "lamina/edit.h"
#include "lamina/frame.h"
#include "lamina/points.h"
#include "lamina/run.h"

namespace lamina {

/// Whether a row is taken from the input at all.
enum class Pick : std::uint8_t { taken, skipped, clipped };
/// Of row i of a batch, which is the input's row `row`.
Pick judge(const RowPick& pick, const SampleBatch& batch, std::size_t i, std::uint64_t row);

/// Why a sample cannot be used.
enum class Defect : std::uint8_t { none, position, normal, radius, quality };
inline constexpr int kDefects = 5;
const char* describe(Defect defect);
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

}  // namespace lamina
