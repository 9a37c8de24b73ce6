// The counts of all ranks as those of one run.
#pragma once
#include "lamina/surface.h"
#include "ranks/ranks.h"

namespace lamina::ranks {

/// Adds up what ranks have counted apart, on all of them; peak memory is the most of one rank, wall clock stays.
void sum_stats(Ranks& ranks, SurfaceStats& stats);

}  // namespace lamina::ranks
