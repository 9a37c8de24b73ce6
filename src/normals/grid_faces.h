// The faces between the lines of an organised scan, and what they say of the samples on a line.
#pragma once
#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <deque>
#include <vector>

#include "lamina/normals.h"

namespace lamina::normals {

/// The samples of one line of the grid; places without one are not finite.
using GridLine = std::vector<Eigen::Vector3d>;

class GridFaces {
 public:
  GridFaces(std::size_t length, const Viewpoint& scanner) : length_(length), scanner_(scanner) {}
  /// The next line, `length` places.
  void add(GridLine line);
  /// Normals of the line `kRing` lines before the last one added (0 0 0: none): final, as its faces are all there.
  /// Called after each add(); at the end add lines without samples.
  [[nodiscard]] std::vector<std::array<float, 3>> finished() const;
  static constexpr std::size_t kRing = 2;  ///< faces to either side that a normal is made of

 private:
  struct Face {
    Eigen::Vector3d normal{0, 0, 0};  ///< as long as twice the area; 0: none
    Eigen::Vector3d centre{0, 0, 0};
  };
  [[nodiscard]] Face face(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c) const;
  [[nodiscard]] Face quad(const GridLine& low, const GridLine& high, std::size_t at) const;
  [[nodiscard]] std::array<float, 3> normal_at(std::size_t at) const;

  std::size_t length_;
  Viewpoint scanner_;
  std::deque<GridLine> lines_;            ///< the last 2 kRing + 1
  std::deque<std::vector<Face>> strips_;  ///< between them
};

}  // namespace lamina::normals
