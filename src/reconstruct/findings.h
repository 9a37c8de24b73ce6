// What was seen of a cloud and chosen for it, in a paragraph for a reader; SurfacePlan has the same as numbers.
#pragma once
#include <string>

#include "lamina/surface.h"

namespace lamina {

/// Two or three lines: the samples, their scans, spacing, noise and where it is most, normals and strays; then every
/// choice that the settings left open, as the option that would have made it.
std::string describe_findings(const SurfaceSettings& settings, const SurfaceStats& stats);

}  // namespace lamina
