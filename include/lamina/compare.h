// How far two surfaces lie apart: two-sided distance of samples, exact to the other's triangles (the measure of Metro,
// Cignoni, Rocchini, Scopigno 1998).
#pragma once
#include <cstdint>
#include <optional>

#include "lamina/mesh.h"
#include "lamina/run.h"

namespace lamina {

struct CompareSettings {
  std::uint64_t count = 1'000'000;  ///< samples per side, > 0; stratified, uniform by area
  std::uint64_t seed = 1;
  bool vertices = false;  ///< the samples are each side's vertices that triangles use: what of the error is their own
};

/// Distances from one surface's samples to the other surface, world units.
struct DistanceStats {
  std::uint64_t samples = 0;
  double rms = 0, mean = 0, p99 = 0, max = 0;  ///< p99: 99 % of the samples lie no farther
};

struct CompareResult {
  std::optional<DistanceStats> a_to_b;  ///< samples of A to the triangles of B; empty when B has no triangles
  std::optional<DistanceStats> b_to_a;
  double diagonal = 0;  ///< of the bounding box of B's referenced vertices, the truth: what relative figures divide by
};

/// Compares a mesh with the truth. A side without triangles is a point cloud: its points are the samples, and nothing
/// is measured towards it. Triangles without area count as the segment or point they are. The result is the same bits
/// for any number of threads. Throws Error(usage) when count is 0, Error(unreadable) when neither side has triangles or
/// a sampled side has no area.
CompareResult compare(const TriangleMesh& a, const TriangleMesh& b, const CompareSettings& settings,
                      const RunContext& run = {});

}  // namespace lamina
