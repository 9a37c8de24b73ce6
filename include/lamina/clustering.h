// How isovertices that share a lattice corner become one vertex of the mesh (Cuccuru et al. 2009, section 3.5).
#pragma once
#include <cstdint>

namespace lamina {

enum class ClusterMode {
  none,        ///< every isovertex stays
  free,        ///< all of a corner become one; may join sheets that come close
  preserving,  ///< only where the mesh stays homeomorphic to the isosurface
};

struct ClusterCounts {
  std::uint64_t corners = 0;           ///< clusters seen
  std::uint64_t collapsed = 0;         ///< collapsed to the projected point
  std::uint64_t patches = 0;           ///< components placed by quadric
  std::uint64_t kept_isovertices = 0;  ///< isovertices left as they were
  std::uint64_t resolved = 0;          ///< clusters that took the exact test
};

}  // namespace lamina
