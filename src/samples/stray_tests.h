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

/// Whether fewer than `least` of the company lie on the surface of a sample, and too few exactly.
bool is_off_surface(const Placed& s, std::size_t place, const Company& company, float least);
/// The same by positions alone: its surface is the plane that its company lies along.
bool is_off_plane(const Placed& s, std::size_t place, const Company& company, float least);

/// Of a place and its company; not known where these are fewer than kStrayNeighbours.
Scatter scatter_of(const Placed& s, std::size_t place, const Company& company, SampleNormals normals);
/// Whether samples fill the space around a place instead of lying on surfaces, by the means of what is known of it and
/// its company.
bool fills_space(const Surroundings& known, std::size_t place, const Company& company);

}  // namespace lamina
