// How far samples act and how fine the cells are, by what the survey saw of the cloud, where the user gave no numbers.
#pragma once
#include <string>

#include "lamina/holes.h"
#include "lamina/surface.h"
#include "samples/radii.h"

namespace lamina {

struct SupportChoice {
  double blend = 1.2;  ///< H
  Length cell{0.9, Length::Unit::influence_radius};
  double refit = 0;         ///< SurfaceSettings::refit
  float band = 2.25F;       ///< ProjectSettings::band
  float good_reach = 0.4F;  ///< ProjectSettings::good_reach
  int good_samples = 3;     ///< ProjectSettings::good_samples
  bool thin_cells = false;  ///< FeedSettings::thin_cells
  bool watertight = false;  ///< HoleSettings::watertight
};

/// A function of settings and survey alone, so that all parts of a job choose the same.
SupportChoice choose_support(const SurfaceSettings& settings, const RadiusSurvey& survey);

/// Which holes are closed: none with free clustering.
HoleSettings hole_settings(const SurfaceSettings& settings, const SupportChoice& support);

/// What was chosen and why, in a line for a reader; empty where the settings gave all of it.
std::string describe_choice(const SurfaceSettings& settings, const SurfacePlan& plan);

}  // namespace lamina
