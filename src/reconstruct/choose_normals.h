// Whose normals a reconstruction takes: the input's, or ones found for it.
#pragma once
#include <memory>
#include <optional>
#include <string>

#include "lamina/normals.h"
#include "lamina/points.h"
#include "lamina/run.h"
#include "lamina/surface.h"

namespace lamina {

/// The source itself where its normals do, else with the ones found as settings.normals asks. In a dry run, which asks
/// for nothing but the plan, they are made up. Says what was found and warns of what is wrong with it.
std::unique_ptr<PointSource> choose_normals(std::unique_ptr<PointSource> source, const SurfaceSettings& settings,
                                            std::optional<NormalsReport>& report, const std::string& tmp_dir,
                                            const RunContext& run);

/// What the settings ask for in words: others where other normals come out.
std::string normals_words(const SurfaceSettings& settings);

}  // namespace lamina
