// From the input's samples to the slab store: validated, rotated, fixed-point, bucketed along the sweep axis.
#pragma once
#include <optional>

#include "lamina/frame.h"
#include "lamina/points.h"
#include "lamina/run.h"
#include "lamina/slab_store.h"
#include "lamina/surface.h"
#include "surface/survey.h"
#include "window/window.h"

namespace lamina {

/// Where the samples lie, fixed-point, inclusive.
struct Extent : Bounds {
  std::int32_t z_min = 0, z_max = -1;
};

struct Ingested {
  SlabStore store;
  Extent extent;
};

/// Second pass over the input; samples with a defect are left out.
Ingested ingest(PointSource& source, const Survey& survey, const Frame& frame, double radius_scale,
                const std::string& directory, const RunContext& run);

}  // namespace lamina
