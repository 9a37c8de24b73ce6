// Which corner's vertex takes on a crease.
//
// A corner has a vertex when the surface crosses one of its edges in the half that is its own. A sharp edge may pass
// through a corner's cube and cross none of these; then the nearest corner around that has a vertex takes it there, and
// the triangles beside it lie on the sheets.
#pragma once
#include <cstdint>

#include "octree/window.h"

namespace lamina {

/// Whether the vertex of a corner goes to the crease that its record knows of, at `record`'s channels. A function of
/// the trusted corners within three cells, in the slab, the one below and the one above, which must be projected; a
/// corner whose question leads out of these stays where it is.
bool takes_crease(const Window& window, int level, const Cell& corner, std::int32_t slab, const float* record);

}  // namespace lamina
