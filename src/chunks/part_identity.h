// What the parts of one reconstruction have in common.
#pragma once
#include <cstdint>
#include <string>

#include "lamina/surface.h"
#include "reconstruct/plan.h"

namespace lamina {

/// The settings that the mesh's bytes depend on, one a line.
std::string mesh_settings(const SurfaceSettings& settings);

/// A number that parts of different stores, settings, lattices or versions of the program do not share (FNV-1a).
std::uint64_t job_hash(const SurfaceSettings& settings, const std::string& input_id, const ReconstructionPlan& plan);

/// Throws Error(usage) for settings that cannot be met in parts.
void require_mesh_alone(const SurfaceSettings& settings, const std::string& option);

}  // namespace lamina
