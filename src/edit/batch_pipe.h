// All rows of a source through several threads and back in order.
#pragma once
#include <functional>
#include <string_view>

#include "lamina/points.h"
#include "lamina/run.h"

namespace lamina::edit {

/// Calls work(batch) for every batch, several at once, then take(batch) in the order of the rows, one at a time.
/// Throws Error(internal, "cancelled") when the run is.
void for_each_batch(PointSource& source, std::string_view stage, const RunContext& run,
                    const std::function<void(SampleBatch&)>& work, const std::function<void(SampleBatch&)>& take);

}  // namespace lamina::edit
