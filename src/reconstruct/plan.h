// Turns settings and a look at the cloud into the lattice and what the run will take.
#pragma once
#include "lamina/frame.h"
#include "lamina/surface.h"
#include "lattice/lattice.h"
#include "mls/refit_normals.h"
#include "reconstruct/choose_support.h"
#include "samples/radii.h"
#include "samples/sample_feed.h"
#include "store/ingest.h"
#include "store/slab_store.h"

namespace lamina {

struct Resolved {
  Lattice lattice;
  FeedSettings feed;
  RadiiSettings radii;
  SurfacePlan plan;
  SupportChoice support;
  RefitSettings refit;  ///< support 0: normals stay
  int main_level = 0;   ///< of most cells
};

/// NormalFilter::reach() of what `refit` asks for.
double filter_reach(const Resolved& resolved);

/// Throws Error(usage) for settings out of range. Called before the input is opened.
void check_settings(const SurfaceSettings& settings);

/// Throws Error(usage) when the cell asked for cannot be represented for this cloud.
Resolved resolve_plan(const SurfaceSettings& settings, const Frame& frame, const SlabStore& store, const Extent& bounds,
                      bool given_radii, std::size_t attributes);

/// The same after a survey_radii() of the store with kSurveySamples and settings.density.
Resolved resolve_plan(const SurfaceSettings& settings, const Frame& frame, const SlabStore& store, const Extent& bounds,
                      const RadiusSurvey& radii, bool given_radii, std::size_t attributes);

/// Processor seconds of a whole run on the machine the model was made on; of which reading the input takes
/// kReferenceRead a sample.
double expected_cpu_seconds(const SurfaceSettings& settings, const Resolved& resolved, std::size_t attributes);
inline constexpr double kReferenceRead = 80e-9;

/// The plan in lines for a reader.
std::string describe(const SurfacePlan& plan);

}  // namespace lamina
