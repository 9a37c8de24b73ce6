// How far the surface at a corner reaches beyond the samples that speak for it: what its rims are cut by.
//
// The weighted mean of the samples around a point of a surface lies near that point where they lie on all sides of it,
// and leans to one side at a rim: by 0.235 of the support on the straight edge of evenly spread samples, by more beyond
// (docs/method.md, "Rims"). The validity test of Adamson and Alexa (2004) is about the same distance, corner by corner;
// here it is a vector, so that what chance adds to it averages out among neighbours while what a rim adds does not.
#pragma once
#include <array>

#include "octree/corner_block.h"

namespace lamina {

/// A corner that leans by less than this share of the overhang at which rims are cut, and is trusted, has samples on
/// all sides without asking others: its own lean will do.
inline constexpr float kUpright = 0.55F;
/// Neighbours belong to the same sheet while the cosine between their normals is more than this (60 degrees).
inline constexpr float kSheetCosine = 0.5F;
/// A corner that has no samples of its own leans towards those neighbours that do, by so much for each cell: the mean
/// of the samples follows a point half of the way when it moves over a rim.
inline constexpr float kLeanPerCell = 0.5F;

/// The vector from a projected point to the mean of its samples, in support radii, as a record of corner values holds
/// it: ten bits for each component, cut off at one radius.
float packed_lean(const std::array<float, 3>& lean);
std::array<float, 3> unpacked_lean(float packed);

/// The length of a corner's own lean along the surface with this normal (support radii); `record`: its values.
float own_overhang(const float* record, const std::array<float, 3>& normal);

/// The length, along the surface, of the mean lean of a corner and its neighbours on the same sheet (support radii); 1
/// where there are none. `block` and `offset`: the corner in the finest level that holds it, whose slabs have so many
/// layers in a leaf; `normal`: its own. The slabs around must be projected.
float overhang(const CornerBlock& block, int offset, int slab_layers, const std::array<float, 3>& normal);

}  // namespace lamina
