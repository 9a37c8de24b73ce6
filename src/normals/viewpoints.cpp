#include "normals/viewpoints.h"

#include <algorithm>
#include <cmath>

namespace lamina::normals {

std::vector<SeenFrom> scanners_of(const PointSourceInfo& info, const NormalsSettings& settings) {
  std::vector<SeenFrom> seen;
  const bool one_each = settings.viewpoints.size() > 1 && settings.viewpoints.size() == info.scans.size();
  for (std::size_t i = 0; i < info.scans.size(); ++i) {
    const ScanPart& scan = info.scans[i];
    SeenFrom s;
    s.first = scan.first;
    if (one_each) {
      s.known = true;
      s.viewpoint = settings.viewpoints[i];
    } else if (settings.viewpoints.empty() && settings.scanners) {
      const bool known = scan.scanner == ScanPart::Scanner::position || scan.scanner == ScanPart::Scanner::direction;
      s.known = known || (settings.pose_origins && scan.scanner == ScanPart::Scanner::pose_origin);
      s.viewpoint = {scan.at, scan.scanner == ScanPart::Scanner::direction};
    }
    seen.push_back(s);
  }
  return seen;
}

Viewpoints::Local Viewpoints::local(const Viewpoint& viewpoint, const Frame& frame) {
  const Eigen::Vector3d at(viewpoint.at[0], viewpoint.at[1], viewpoint.at[2]);
  const Eigen::Vector3d there =
      viewpoint.direction ? Eigen::Vector3d((frame.rotation * at).normalized()) : frame.to_local(at);
  return {{there.x(), there.y(), there.z()}, viewpoint.direction};
}

Viewpoints::Viewpoints(const std::vector<Viewpoint>& everywhere, const std::vector<SeenFrom>& by_row,
                       const Frame& frame) {
  for (const Viewpoint& v : everywhere) everywhere_.push_back(local(v, frame));
  any_ = !everywhere.empty();
  for (const SeenFrom& rows : by_row) {
    by_row_.push_back({rows.first, rows.known, local(rows.viewpoint, frame)});
    any_ = any_ || rows.known;
  }
}

float Viewpoints::vote(std::uint64_t row, const std::array<std::int32_t, 3>& at,
                       const std::array<float, 3>& normal) const {
  const auto sight = [&](const Local& from) {
    if (from.direction) return from.at;
    return std::array<double, 3>{from.at[0] - at[0], from.at[1] - at[1], from.at[2] - at[2]};
  };
  const auto squared = [](const std::array<double, 3>& d) { return d[0] * d[0] + d[1] * d[1] + d[2] * d[2]; };
  std::array<double, 3> line{};
  const auto rows =
      std::upper_bound(by_row_.begin(), by_row_.end(), row, [](std::uint64_t r, const Rows& s) { return r < s.first; });
  if (rows != by_row_.begin() && std::prev(rows)->known) {
    line = sight(std::prev(rows)->viewpoint);
  } else {
    double nearest = 0;
    for (const Local& from : everywhere_) {
      const std::array<double, 3> d = sight(from);
      const double d2 = squared(d);
      if (&from != everywhere_.data() && !(d2 < nearest)) continue;
      nearest = d2;
      line = d;
    }
  }
  const double length = std::sqrt(squared(line));
  if (!(length > 0)) return 0;
  return static_cast<float>((line[0] * normal[0] + line[1] * normal[1] + line[2] * normal[2]) / length);
}

}  // namespace lamina::normals
