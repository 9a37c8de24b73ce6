// The shape of a cluster with at most one member per direction, read from a few bits.
#pragma once
#include "clustering/record.h"

namespace lamina::clustering {

/// For a cluster away from boundaries: true when
/// - its induced complex is contractible (condition C), and
/// - no neighbour that fulfils C and R can fail Q because of it. That would need a vertex x met twice on the
/// neighbour's
///   ring; between the two visits the ring walks through members whose triangles all lie in the two clusters, and as
///   the complex is contractible, removing x cuts these off as a component of idle members only. Without such an x:
///   true.
bool plain_shape(const CornerNote& note);

}  // namespace lamina::clustering
