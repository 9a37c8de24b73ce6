// Points in another order, more of them than memory holds.
#pragma once
#include <cstddef>
#include <string>

#include "lamina/edit_points.h"

namespace lamina {

enum class SortKey {
  x,
  y,
  z,
  sweep,      ///< along the dominant axis of the cloud, the one a reconstruction sweeps along
  spatial,    ///< along a space-filling curve (Morton): neighbours in the file are neighbours in space
  attribute,  ///< by a column's values
};

struct SortSettings {
  SortKey key = SortKey::spatial;
  std::string attribute;  ///< SortKey::attribute: its name
  bool reverse = false;   ///< descending
  BadSamples bad_samples = BadSamples::drop;
  std::size_t memory = std::size_t{256} << 20;  ///< for rows being sorted; at most a quarter of run.max_memory
};

/// Writes the source's rows in the order of their keys; equal keys keep their order. Values are the same bits as
/// before. Needs two passes over the input (by attribute one), a temporary file of the size of the cloud in
/// run.tmp_dir (empty: the system's) where it is larger than settings.memory. Throws Error(usage) for an attribute that
/// is not there, naming those that are, Error(budget) when the disk is full or run.max_memory too little. Does not
/// commit.
EditReport sort_points(PointSource& source, PointsWriter& writer, const SortSettings& settings,
                       const RunContext& run = {});

}  // namespace lamina
