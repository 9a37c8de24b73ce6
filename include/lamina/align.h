// Scans of one cloud that do not quite agree, moved until they do.
#pragma once
#include <cstdint>
#include <memory>

#include "lamina/points.h"
#include "lamina/run.h"

namespace lamina {

/// What was found of the scans that a cloud is made of. Lengths in input units.
struct ScanAlignment {
  std::uint64_t scans = 1;   ///< that the input tells apart
  std::uint64_t places = 0;  ///< looked at where two of them see the same surface
  double before = 0;         ///< median distance of two scans there, along the surface's normal
  double after = 0;          ///< the same once they are moved; `before` where they are not
  double farthest = 0;       ///< how far a sample moves at most; 0 where none does
  [[nodiscard]] bool moved() const { return farthest > 0; }
};

/// The source itself, or, where its scans agree better after small rigid motions of each as a whole, with its points
/// and normals so moved. Scans are files, those that a file tells apart (PointSourceInfo::scans), else the values of an
/// attribute `scan`; the cloud must have normals. All scans share in the correction, so that the cloud as a whole stays
/// where it is. What disagrees by more than some eight spacings is no small error, and left as it is; so are clouds
/// seen from above, more than 128 scans, and scans that hardly overlap. Reads the source twice to four times, and
/// keeps a few MB.
/// The result depends on the rows alone. Throws what the source throws, and Error(internal) when cancelled.
std::unique_ptr<PointSource> align_scans(std::unique_ptr<PointSource> source, ScanAlignment& found,
                                         const RunContext& run);

}  // namespace lamina
