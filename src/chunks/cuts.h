// Where a sweep is cut into chunks that take about the same time, and what their parts have in common.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "lamina/surface.h"
#include "reconstruct/plan.h"
#include "reconstruct/stages.h"
#include "store/slab_store.h"

namespace lamina {

/// Samples in each slab of the plan: a bucket's are taken to lie evenly between its lowest and its highest one.
std::vector<double> slab_samples(const ReconstructionPlan& plan, const SlabStore& store);

/// Samples in the slabs of a span, as slab_samples() has them.
std::uint64_t samples_in(const ReconstructionPlan& plan, const SlabStore& store, const SlabSpan& span);

/// `count` spans that follow each other through the slabs of the plan, the last ones empty where there are fewer slabs
/// than that. The largest cost of a chunk, the slabs it works on beside its own included, is as small as it can be. A
/// function of plan, store and count alone.
std::vector<SlabSpan> cut(const ReconstructionPlan& plan, const SlabStore& store, int count);

/// What a chunk of slabs [begin, end) costs, from what each slab does: those beside it are read and projected, too.
double chunk_cost(const std::vector<double>& cost, std::size_t begin, std::size_t end);

/// The same spans from what each slab costs; the first is slab number `first`.
std::vector<SlabSpan> cut(const std::vector<double>& cost, std::int32_t first, int count);

/// The settings that the mesh's bytes depend on, one a line.
std::string mesh_settings(const SurfaceSettings& settings);

/// A number that parts of different stores, settings, lattices or versions of the program do not share (FNV-1a).
std::uint64_t job_hash(const SurfaceSettings& settings, const std::string& input_id, const ReconstructionPlan& plan);

/// Throws Error(usage) for settings that cannot be met in parts.
void require_mesh_alone(const SurfaceSettings& settings, const std::string& option);

}  // namespace lamina
