// Where samples were seen from: what that says about the sign of their normals.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "lamina/frame.h"
#include "lamina/normals.h"

namespace lamina::normals {

/// Rows from `first` on, up to the next one's, were seen from `viewpoint`, where there is one.
struct SeenFrom {
  std::uint64_t first = 0;
  bool known = false;
  Viewpoint viewpoint;
};

/// Where the parts of an input were seen from, as its file or the settings say; rows ascending.
std::vector<SeenFrom> scanners_of(const PointSourceInfo& info, const NormalsSettings& settings);

class Viewpoints {
 public:
  /// `everywhere`: of rows that `by_row` (ascending) knows nothing about; each sample takes the nearest.
  Viewpoints(const std::vector<Viewpoint>& everywhere, const std::vector<SeenFrom>& by_row, const Frame& frame);
  [[nodiscard]] bool any() const { return any_; }
  /// Cosine between the normal and the line of sight to the viewer, 0 where nothing is known. Steps of the frame.
  [[nodiscard]] float vote(std::uint64_t row, const std::array<std::int32_t, 3>& at,
                           const std::array<float, 3>& normal) const;

 private:
  struct Local {
    std::array<double, 3> at{};
    bool direction = false;
  };
  struct Rows {
    std::uint64_t first = 0;
    bool known = false;
    Local viewpoint;
  };
  static Local local(const Viewpoint& viewpoint, const Frame& frame);
  std::vector<Local> everywhere_;
  std::vector<Rows> by_row_;
  bool any_ = false;
};

}  // namespace lamina::normals
