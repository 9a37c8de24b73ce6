// Stray samples: those that lie on no surface of their neighbours. What scanners put in front of and behind edges,
// dust, rain and reflections leave by a test that looks at each sample's own neighbourhood, so that it holds wherever
// the density varies.
#pragma once
#include <cstdint>

#include "lamina/run.h"
#include "samples/outliers.h"
#include "store/slab_store.h"

namespace lamina {

/// Nearest samples that a sample is compared with.
inline constexpr std::size_t kStrayNeighbours = 12;
/// A sample is lonely when its neighbours are so many times farther away than theirs are. On a surface sampled at
/// random the ratio is under 2; where density changes by a step it is that of the spacings, on one side of the step
/// alone.
inline constexpr float kLonely = 2.5F;
/// Neighbours lie on the surface of a sample when they are within this share of the neighbourhood's radius of its
/// tangent plane and their normal lies within this cosine (75 degrees) of its own. Which of the two ways they face is
/// not asked: it is often wrong.
inline constexpr float kNearPlane = 0.5F;
inline constexpr float kAlongSurface = 0.26F;
/// Which of two ways they face is asked where the neighbours agree among themselves: where the mean of their normals is
/// at least so long. That of a dozen normals with signs by chance is a third.
inline constexpr float kAgreeing = 0.7F;
/// A sample lies on no surface when fewer of its neighbours than this share do: of a ball filled at random a third is
/// near the plane, and a third of those face along it; at a right edge half of them do.
inline constexpr float kLeastOnSurface = 0.35F;
/// At the corner of a cube a third of them do, but these exactly: within so little of the plane, facing the same way to
/// within 25 degrees. Where so large a share does the sample stays; chance puts one in twenty so near.
inline constexpr float kOnPlane = 0.05F;
inline constexpr float kSameWay = 0.9F;
inline constexpr float kLeastExact = 0.2F;
/// A few strays far from everything but each other have chance company, and most of so few lie near the plane of one of
/// them. Where fewer neighbours are found than are looked for, though there are many not much farther away, more is
/// asked for: so many neighbours, so large a share of them on the sample's surface.
inline constexpr std::size_t kLeastCompany = 6;
inline constexpr float kLeastOnSparseSurface = 0.5F;
/// Many: within twice the distance a surface of even density has four times as many.
inline constexpr std::size_t kManyBeside = 64;

struct StrayCounts {
  std::uint64_t lonely = 0;       ///< far from their neighbours
  std::uint64_t off_surface = 0;  ///< on no surface of their neighbours
  [[nodiscard]] std::uint64_t all() const { return lonely + off_surface; }
};

/// Clears the masks of stray samples; those they find cleared are not there. Where many go, those left are tested
/// again. `reasons`: where wanted, is told of each. Depends on the cloud alone. Memory: some 60 bytes for each sample
/// of twelve dozen spacings of the cloud's height.
StrayCounts drop_strays(const SlabStore& store, KeepMasks& masks, const RunContext& run, Reasons* reasons = nullptr);

}  // namespace lamina
