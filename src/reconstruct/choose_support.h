// How far samples act and how fine the cells are: as the user says, else by what the survey saw of the cloud.
#pragma once
#include "isosurface/number_edges.h"
#include "lamina/holes.h"
#include "lamina/points.h"
#include "lamina/surface.h"
#include "mls/project.h"
#include "mls/refit_normals.h"
#include "samples/sample_feed.h"
#include "samples/sampling_survey.h"

namespace lamina {

/// Settings of the stages with what noise and evenness of the sampling decide; lengths that need the lattice are left
/// for the plan.
struct StageSettings {
  FeedSettings feed;
  RefitSettings refit;
  ProjectSettings projection;
  HoleSettings holes;
  double trim = 0;  ///< VertexSettings::trim
  DoubtfulPoints doubtful = DoubtfulPoints::near_samples;
};

/// A function of settings and survey alone, so that all parts of a job choose the same.
StageSettings choose_support(const SurfaceSettings& settings, const RadiusSurvey& survey, const PointSourceInfo& info);

/// SimplifySettings::deviation of a mesh of such samples: noise says how much of what is not flat is none of the
/// surface's.
double choose_deviation(const RadiusSurvey& survey);

}  // namespace lamina
