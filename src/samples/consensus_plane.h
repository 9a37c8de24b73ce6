// The plane, slightly bent, through a sample that most of its neighbours lie on: beside a sharp edge, that of its side.
#pragma once
#include <array>
#include <cstddef>
#include <vector>

namespace lamina {

/// How far neighbours are looked for, sample radii: four spacings, some fifty samples, half of them on either side of
/// an edge.
inline constexpr float kConsensusReach = 2;
/// How far from a plane a neighbour may lie and count for it a little, sample radii: positions are exact where normals
/// are looked at by them.
inline constexpr float kConsensusDistance = 0.02F;
/// So many times more must speak for another plane than for the one of the sample's own normal.
inline constexpr float kConsensusGain = 1.3F;

/// One thread's.
class ConsensusPlane {
 public:
  /// Neighbours of the sample that is being looked at, relative to it and in units of the distance they are looked for
  /// within (kConsensusReach radii where the next ones stay as they are), so that all are nearer than one. Cleared by
  /// the caller.
  std::vector<std::array<float, 3>> neighbours;
  /// How far from a plane they may lie and count for it a little, in the same units.
  float distance = kConsensusDistance / kConsensusReach;
  /// Planes are tried through pairs of the nearest of them, of every so many one: noisy ones are to lie far apart.
  std::size_t stride = 1;

  /// The normal at the origin of the surface through it that most neighbours lie on, on the side of `own`, which must
  /// be a unit vector; false where none is much better than `own`. Planes are those through two of the nearest
  /// neighbours (random sample consensus without chance: Fischler and Bolles 1981); to the neighbours of the best a
  /// quadric is fitted. Depends on the order of the neighbours by rounding alone.
  bool find(const std::array<float, 3>& own, std::array<float, 3>& normal);

 private:
  void lay_out();
  [[nodiscard]] float score(const std::array<float, 3>& normal) const;

  std::vector<float> x_, y_, z_, weight_;  ///< of the neighbours, filled up with such as do not count
};

}  // namespace lamina
