// First steps of a slab in the clusterer: its notes are laid out, then its triangles are counted into them.
#pragma once
#include "clustering/record.h"

namespace lamina::clustering {

/// Fills a fresh record for `iso`: the cluster of each vertex and the slot of each corner.
/// Throws Error(internal) where an index leaves this slab's corners.
void lay_out(SlabRecord& record, std::shared_ptr<const IsoSlab> iso);

/// Counts the triangles of `slab` into the notes of `slab` and the next one, and lists its border triangles.
/// Throws Error(internal) where an index leaves the tables of the two slabs.
void count_triangles(Window& window, std::int64_t slab, ClusterMode mode);

}  // namespace lamina::clustering
