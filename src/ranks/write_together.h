// One mesh, written by all ranks at their places in one file.
#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "chunks/part_file.h"
#include "lamina/holes.h"
#include "ranks/rank_slabs.h"
#include "ranks/ranks.h"
#include "reconstruct/job.h"
#include "reconstruct/stages.h"

namespace lamina::ranks {

/// What ranks must know of each other's parts: small, whatever the mesh.
struct Border {
  SlabSpan span;
  bool any = false;
  SlabMark below, last;
  std::uint64_t vertices = 0, triangles = 0;
};

/// Where a rank's part begins in the mesh, and how large that is.
struct Place {
  std::uint64_t first_vertex = 0, first_triangle = 0;
  std::uint64_t vertices = 0, triangles = 0;
};

/// The place of part `rank`. Throws Error(internal) where two parts do not agree on the surface between them, and
/// Error(budget) beyond the vertices that a PLY's indices can name; `name`: the mesh, for the message.
Place find_place(std::span<const Border> parts, std::size_t rank, const std::string& name);

/// Writes the plan's mesh under its names, holes closed; it appears when all have written. The place is that
/// of this rank, the holes are known to rank 0 (job.stats). Throws Error(empty) where no rank has a triangle.
Place write_together(Ranks& ranks, const ReconstructionPlan& plan, RankSlabs& part,
                     const std::vector<std::string>& outputs, Job& job);

}  // namespace lamina::ranks
