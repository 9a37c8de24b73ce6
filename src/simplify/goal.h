// How far a simplification is to go: one of a number of triangles, a share of them, and a bound on the error.
#pragma once
#include <cstdint>

#include "lamina/run.h"
#include "lamina/simplify.h"

namespace lamina::simplify {

/// Throws Error(usage) where not one of the three is given, or out of range.
void require_goal(const SimplifySettings& settings);

/// How many triangles are wanted of so many; 0 where a bound says it. Throws Error(usage) for more than there are.
std::uint64_t wanted_triangles(const SimplifySettings& settings, std::uint64_t there);

/// What is left to do for a mesh that a run has made: for more triangles than there are nothing, which is said.
SimplifySettings goal_for(const SimplifySettings& settings, std::uint64_t there, const RunContext& run);

}  // namespace lamina::simplify
