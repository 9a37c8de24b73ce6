// Rows of a binary little-endian PLY of points.
#pragma once
#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace lamina::scatter_detail {

struct RowLayout {
  bool double_positions = false;
  bool colours = false;
  bool confidence = false;
};

/// Header for `count` points in the layout.
std::string ply_header(const RowLayout& layout, std::uint64_t count, const std::vector<std::string>& comments = {});

/// Packs rows behind one another.
class RowPacker {
 public:
  explicit RowPacker(const RowLayout& layout) : layout_(layout) {}
  void add(const std::array<double, 3>& position, const std::array<double, 3>& normal,
           const std::array<float, 3>& colour, float confidence = 0);
  void reserve(std::size_t rows) { bytes_.reserve(rows * 43); }
  [[nodiscard]] const std::string& bytes() const { return bytes_; }

 private:
  RowLayout layout_;
  std::string bytes_;
};

}  // namespace lamina::scatter_detail
