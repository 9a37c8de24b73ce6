#include "levelset/grid_frame.h"

#include <fmt/format.h>

#include <cmath>

#include "lamina/error.h"

namespace lamina::volume {

GridFrame::GridFrame(const Frame& frame, const Lattice& lattice, int level)
    : voxel(frame.step * lattice.cell_size(level)) {
  // OpenVDB takes a smaller voxel for a singular transform.
  constexpr double kSmallest = 1.5e-5;
  if (voxel < kSmallest) {
    throw Error(ExitCode::usage, fmt::format("--vdb: a voxel of {:.3g} is smaller than OpenVDB holds ({:g}); give the "
                                             "points in smaller units (millimetres, not metres), or --vdb-voxelsize",
                                             voxel, kSmallest));
  }
  bool permuted = true;
  for (int k = 0; k < 3; ++k) {
    int largest = 0;
    permuted = permuted && frame.rotation.row(k).maxCoeff(&largest) == 1;
    axis_of[static_cast<std::size_t>(k)] = largest;
  }
  const openvdb::Vec3d origin(frame.origin[0], frame.origin[1], frame.origin[2]);
  if (permuted) {
    transform = openvdb::math::Transform::createLinearTransform(voxel);
    transform->postTranslate(origin);
    return;
  }
  axis_of = {0, 1, 2};
  openvdb::Mat4d m = openvdb::Mat4d::identity();
  for (int k = 0; k < 3; ++k)
    for (int a = 0; a < 3; ++a) m(k, a) = voxel * frame.rotation(k, a);  // OpenVDB multiplies row vectors from the left
  m.setTranslation(origin);
  transform = openvdb::math::Transform::createLinearTransform(m);
}

}  // namespace lamina::volume
