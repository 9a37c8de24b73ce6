// From the input's samples to the slab store: validated, rotated, fixed-point, bucketed along the sweep axis.
#pragma once
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <utility>

#include "lamina/frame.h"
#include "lamina/points.h"
#include "lamina/run.h"
#include "lattice/lattice.h"
#include "store/input_survey.h"
#include "store/slab_store.h"

namespace lamina {

struct Ingested {
  SlabStore store;
  Extent extent;
  Census census;         ///< of the rows read
  bool complete = true;  ///< false: a sample lies too far outside the box surveyed, and reading stopped there
  double overlap = 0;    ///< ScanOverlap::share()
};

/// Where a store's files go, and whether they have names and stay (StoreSettings::keep).
struct StorePlace {
  std::string directory;
  bool keep = false;
  StorePlace(std::string in, bool stays = false) : directory(std::move(in)), keep(stays) {}
};

/// Rows [first, end) of an input, as far as there are.
struct RowSpan {
  std::uint64_t first = 0, end = std::numeric_limits<std::uint64_t>::max();
};

struct IngestSettings {
  double radius_scale = 1;  ///< multiplies given radii
  RowPick pick{};
  RowSpan rows{};
};

/// Reads the input, or some of its rows, into the store; samples with a defect are left out. After a survey of all rows
/// the result is always complete; after one of a part it need not be.
Ingested ingest(PointSource& source, const Survey& survey, const Frame& frame, const StorePlace& place,
                const RunContext& run, const IngestSettings& settings = {});

}  // namespace lamina
