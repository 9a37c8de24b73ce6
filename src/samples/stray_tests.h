// What makes a sample a stray, by itself: the tests of one place against its company.
#pragma once
#include <cstddef>
#include <cstdint>

#include "samples/cleaning.h"
#include "samples/stray_search.h"

namespace lamina {

/// Which samples of a leaf may be strays: none where they lie close together on one plane and face its way; where some
/// lie far from the others on that plane, those; else all. Neighbourhoods::LeafTest.
void find_doubtful(const Placed& s, const SampleLeaf& leaf, std::uint8_t* doubtful);

/// All of them may be. Neighbourhoods::LeafTest.
void doubt_all(const Placed& s, const SampleLeaf& leaf, std::uint8_t* doubtful);

/// Whether fewer than `least` of the company lie on the surface of a sample, and too few exactly. Not for
/// SampleNormals::none.
bool is_off_surface(const Placed& s, std::size_t place, const Company& company, float least, SampleNormals normals);
/// The same by positions alone: its surface is the plane that its company lies along.
bool is_off_plane(const Placed& s, std::size_t place, const Company& company, float least);

/// The variance of a place and its company along the normal of their plane, as a share of that along their longest
/// axis: 0 on a plane or a line, 0.3 in the middle for a dozen that fill a ball. Negative where the company is smaller
/// than kStrayNeighbours.
float thickness_of(const Placed& s, std::size_t place, const Company& company);
/// How little a place and its company look like samples of a surface; negative as thickness_of(). With normals, by how
/// much they do not lie along one axis, whichever way: 1 - the largest eigenvalue of their mean product with
/// themselves, 0 where all do, 0.5 in the middle where they face anywhere. Without, their thickness.
float scatter_of(const Placed& s, std::size_t place, const Company& company, SampleNormals normals);
/// Whether samples fill the space around a place instead of lying on surfaces, by the mean of what is known of it and
/// its company.
bool fills_space(const Surroundings& known, std::size_t place, const Company& company, SampleNormals normals);

}  // namespace lamina
