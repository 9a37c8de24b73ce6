// Where a sweep is cut into chunks that take about the same time.
#pragma once
#include <cstdint>
#include <vector>

#include "lamina/slab_store.h"
#include "surface/plan.h"
#include "surface/slab_span.h"

namespace lamina {

/// Samples in each slab of `all`: a bucket's are taken to lie evenly between its lowest and its highest one.
std::vector<double> slab_samples(const SlabStore& store, const Lattice& lattice, const SlabSpan& all);

/// `count` spans that follow each other from all.begin to all.end, the last ones empty where there are fewer slabs than
/// that. The largest cost of a chunk, the slabs it works on beside its own included, is as small as it can be. A
/// function of store, lattice and count alone.
std::vector<SlabSpan> cut(const SlabStore& store, const Lattice& lattice, const SlabSpan& all, int count);

/// The same from what each slab costs: for all its stages, and where it only lies beside a chunk.
std::vector<SlabSpan> cut(const std::vector<double>& cost, std::int32_t first, int count);

}  // namespace lamina
