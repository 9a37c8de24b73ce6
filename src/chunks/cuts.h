// Where a sweep is cut into chunks that take about the same time.
#pragma once
#include <cstdint>
#include <vector>

#include "reconstruct/plan.h"
#include "reconstruct/slab_span.h"
#include "store/slab_store.h"

namespace lamina {

/// Samples in each slab of `all`: a bucket's are taken to lie evenly between its lowest and its highest one.
std::vector<double> slab_samples(const SlabStore& store, const Lattice& lattice, const SlabSpan& all);

/// `count` spans that follow each other from all.begin to all.end, the last ones empty where there are fewer slabs than
/// that. The largest cost of a chunk, the slabs it works on beside its own included, is as small as it can be. A
/// function of store, lattice and count alone.
std::vector<SlabSpan> cut(const SlabStore& store, const Lattice& lattice, const SlabSpan& all, int count);

/// What a chunk of slabs [begin, end) costs, from what each slab does: those beside it are read and projected, too.
double chunk_cost(const std::vector<double>& cost, std::size_t begin, std::size_t end);

/// The same spans from what each slab costs; the first is slab number `first`.
std::vector<SlabSpan> cut(const std::vector<double>& cost, std::int32_t first, int count);

}  // namespace lamina
