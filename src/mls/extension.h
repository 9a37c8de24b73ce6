// Finishing a projected slab: every corner gets a sign (DESIGN "Repair, not rejection"; METHOD 3.5).
#pragma once
#include <cstdint>

#include "mls/kernel.h"
#include "octree/window.h"

namespace lamina {

/// Sets `outside` of the slab's corners: the sign of their own trusted distance, else of the distance extended from
/// trusted neighbours, else of their own untrusted one, else outside; and `defined`, which leaves out the last kind
/// and corners whose own projected point lies farther than `boundary` local support radii from the average of its
/// samples (Adamson & Alexa 2004; 0: no limit); and `supported`. A corner that a finer level holds takes that level's
/// bits. The slabs below and above must be projected.
void extend_slab(Window& window, std::int32_t slab, const Kernel& kernel, float boundary);

}  // namespace lamina
