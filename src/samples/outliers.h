// Statistical outliers: samples whose neighbours are much farther away than is usual in the cloud.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "lamina/run.h"
#include "store/slab_store.h"

namespace lamina::clean {

/// Which samples of each bucket stay.
using KeepMasks = std::vector<std::vector<bool>>;

struct OutlierRule {
  std::uint32_t neighbours = 16;
  double sigma = 2;
};

struct Outliers {
  std::uint64_t count = 0;
  double limit = 0;  ///< mean distance from which on samples are outliers, steps
};

/// Clears the masks of outliers; the samples they find cleared are not there. Slides over the store; memory holds the
/// positions of a dozen spacings of its height, an unnamed file in `directory` four bytes for each sample.
Outliers drop_outliers(const SlabStore& store, const OutlierRule& rule, const std::string& directory, KeepMasks& masks,
                       const RunContext& run);

}  // namespace lamina::clean
