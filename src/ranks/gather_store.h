// Samples go where they are worked on: each rank's store holds a part of every bucket, and then whole buckets.
#pragma once
#include <string>
#include <vector>

#include "ranks/ranks.h"
#include "samples/sample_feed.h"
#include "samples/sampling_survey.h"

namespace lamina::ranks {

/// survey_radii() of all ranks' samples, on all ranks: rank 0 looks, the others send what it asks for.
RadiusSurvey survey_together(Ranks& ranks, const SlabStore& store, std::uint64_t sample_limit,
                             std::uint32_t min_samples);

/// A store in `directory` with the buckets that wanted[rank()] names, out of all ranks' stores, compressed blocks as
/// they are. Memory: some 16 MB, whatever the cloud.
SlabStore gather_buckets(Ranks& ranks, const SlabStore& store, const std::vector<BucketSpan>& wanted,
                         const std::string& directory, const RunContext& run);

}  // namespace lamina::ranks
