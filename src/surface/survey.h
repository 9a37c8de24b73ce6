// A first look at the input: what is usable, where it lies, and the frame to compute in (METHOD 3.1).
#pragma once
#include <algorithm>
#include <array>
#include <cstdint>

#include "lamina/frame.h"
#include "lamina/points.h"
#include "lamina/run.h"
#include "lamina/surface.h"

namespace lamina {

/// Why a sample cannot be used.
enum class Defect : std::uint8_t { none, position, normal, radius, quality };
inline constexpr int kDefects = 5;
const char* describe(Defect defect);
/// The defect of sample i of a batch.
Defect defect_of(const SampleBatch& batch, std::size_t i);

/// Largest attribute value a run takes: weighted sums of greater ones would overflow float.
inline constexpr float kLargestAttribute = 1e18F;
/// An attribute's value as a run takes it: NaN (what other programs write for "no value") is 0.
inline float usable_attribute(float value) {
  return value == value ? std::clamp(value, -kLargestAttribute, kLargestAttribute) : 0.0F;
}

struct Survey {
  std::uint64_t usable = 0;
  std::array<std::uint64_t, kDefects> rejected{};
  std::array<std::uint64_t, kDefects> first_row{};
  Eigen::Vector3d low, high;  ///< bounding box, input coordinates
  Eigen::Matrix3d covariance;
  float max_quality = 0;                       ///< where the input gives quality
  std::uint64_t unusable_attributes = 0;       ///< values that usable_attribute() changes
  std::uint64_t first_unusable_attribute = 0;  ///< row of the first
};

/// Reads the whole input once. Throws Error(empty) when nothing usable is there or all samples lie at one place,
/// Error(unreadable) for a defect or an unusable attribute when `bad` is refuse.
Survey survey_input(PointSource& source, BadSamples bad, const RunContext& run);

/// Frame with the sweep axis last; fixed-point coordinates of the cloud stay within +-2^29.
Frame choose_frame(const Survey& survey, FrameMode mode);

}  // namespace lamina
