#include "levelset/corner_points.h"

#include <utility>

#include "vdb/points_grid.h"
#include "vdb/vdb_file.h"

namespace lamina::volume {

CornerPoints::CornerPoints(const VolumeExport& settings, const AttributeLayout& layout, const Frame& frame)
    : path_(settings.points),
      per_file_(settings.points_per_file),
      frame_(frame),
      shift_(settings.shift),
      crs_(settings.crs) {
  points_.layout = layout;
  points_.samples.attributes.resize(layout.size());
  // An output that cannot be written is refused before the work.
  files_.push_back(std::make_unique<ResultFile>(path_));
}

void CornerPoints::add(const IsoSlab& slab) {
  const Eigen::Matrix3d back = frame_.rotation.transpose();
  SampleBatch& s = points_.samples;
  for (std::size_t i = 0; i < slab.corners.size(); ++i) {
    const SurfaceCorner& c = slab.corners[i];
    const Eigen::Vector3d normal(c.normal[0], c.normal[1], c.normal[2]);
    if (!(normal.squaredNorm() > 0.5)) continue;  // nothing was projected there
    const Eigen::Vector3d local(double{c.offset[0]} + c.position[0], double{c.offset[1]} + c.position[1],
                                double{c.offset[2]} + c.position[2]);
    const Eigen::Vector3d world = frame_.to_world(local), n = back * normal;
    s.x.push_back(world[0]);
    s.y.push_back(world[1]);
    s.z.push_back(world[2]);
    s.nx.push_back(static_cast<float>(n[0]));
    s.ny.push_back(static_cast<float>(n[1]));
    s.nz.push_back(static_cast<float>(n[2]));
    // Discs of this radius cover the surface: half the diagonal of a cell's side.
    constexpr float kHalfDiagonal = 0.70711F;
    s.radius.push_back(kHalfDiagonal * c.cell * static_cast<float>(frame_.step));
    for (std::size_t a = 0; a < s.attributes.size(); ++a) s.attributes[a].push_back(slab.corner_attributes[a][i]);
    ++count_;
    if (s.size() == per_file_) write_file();
  }
}

void CornerPoints::write_file() {
  const auto grid = point_grid(points_);
  label(*grid, "points", false);
  if (shift_) note_shift(*grid, *shift_);
  note_crs(*grid, crs_);
  const std::string bytes = vdb_bytes({grid});
  bytes_ += bytes.size();
  files_.back()->write(bytes);
  files_.push_back(std::make_unique<ResultFile>(numbered(path_, files_.size() + 1)));
  SampleBatch& s = points_.samples;
  for (auto* a : {&s.x, &s.y, &s.z}) a->clear();
  for (auto* a : {&s.nx, &s.ny, &s.nz, &s.radius}) a->clear();
  for (auto& a : s.attributes) a.clear();
}

void CornerPoints::finish() {
  if (points_.samples.size() > 0) write_file();
  files_.pop_back();  // begun for points that did not come
}

std::vector<std::string> CornerPoints::commit() {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < files_.size(); ++i) {
    names.push_back(files_.size() == 1 ? path_ : numbered(path_, i + 1));
    files_[i]->commit(names.back());
  }
  return names;
}

}  // namespace lamina::volume
