// Whether normals that came with a cloud can be believed. Those from plane fits have no sign of their own: many
// programs leave them as they fall, turn all of them to one side of a plane, or spread them with gaps. Others write the
// same normal for every sample, and those from the differences of a noisy range image face anywhere.
#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <span>

namespace lamina {

/// Samples and their nearest neighbours.
struct GivenNormals {
  std::uint64_t pairs = 0;       ///< looked at
  std::uint64_t odd = 0;         ///< of these, neighbours that face the other way from most around the sample
  std::uint64_t flat_pairs = 0;  ///< the same where the neighbours lie in a plane, so that noise excuses nothing
  std::uint64_t flat_odd = 0;
  /// By how many deviations of the neighbours' heights those of one side lie above those of the other, on average where
  /// there are some of both: next to none where signs fell by chance, one or more where two sheets lie close together.
  double apart = 0;
  std::uint64_t in_planes = 0;        ///< neighbours, of those samples whose neighbours lie in a plane
  std::uint64_t leaning = 0;          ///< of these, with a normal that leans more than 45 degrees from the plane's
  std::uint64_t in_exact_planes = 0;  ///< the same where they lie in it but for a hundredth
  std::uint64_t off = 0;              ///< of these, with a normal that leans more than 15 degrees
  /// How little the normals of a sample and its neighbours lie along one axis, whichever way, in the middle: 1 - the
  /// largest eigenvalue of their mean product with themselves. 0 where all do, 0.52 where they face anywhere.
  double disorder = 0;

  [[nodiscard]] double share() const { return pairs == 0 ? 0 : static_cast<double>(odd) / static_cast<double>(pairs); }
  [[nodiscard]] double flat_share() const {
    return flat_pairs == 0 ? 0 : static_cast<double>(flat_odd) / static_cast<double>(flat_pairs);
  }
  /// Whether their signs are to be found again.
  [[nodiscard]] bool contradict() const;
  /// Whether they are of another surface, so that all of them are to be found again.
  [[nodiscard]] bool lean() const;
  /// Whether they face nearly anywhere, so that the samples' places tell more of the surface.
  [[nodiscard]] bool scatter() const;
};

/// Looks at some four thousand of the samples. Normals of any length; samples without one (zero, not finite), or whose
/// position is not finite, are left out. Neighbours are the nearest of those given: of a large cloud a part will do, as
/// long as it is dense somewhere.
GivenNormals look_at_normals(std::span<const Eigen::Vector3d> at, std::span<const Eigen::Vector3f> normals);

}  // namespace lamina
