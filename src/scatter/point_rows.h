// Rows of a binary little-endian PLY of points.
#pragma once
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "base/number.h"

namespace lamina::scatter_detail {

struct RowLayout {
  bool double_positions = false;
  bool colours = false;
  bool confidence = false;
};

/// Header for `count` points in the layout.
inline std::string ply_header(const RowLayout& layout, std::uint64_t count,
                              const std::vector<std::string>& comments = {}) {
  std::string h = "ply\nformat binary_little_endian 1.0\n";
  for (const auto& c : comments) h += fmt::format("comment {}\n", c);
  h += fmt::format("element vertex {}\n", count);
  const char* type = layout.double_positions ? "double" : "float";
  for (const char* name : {"x", "y", "z"}) h += fmt::format("property {} {}\n", type, name);
  for (const char* name : {"nx", "ny", "nz"}) h += fmt::format("property float {}\n", name);
  if (layout.colours)
    for (const char* name : {"red", "green", "blue"}) h += fmt::format("property uchar {}\n", name);
  if (layout.confidence) h += "property float confidence\n";
  return h + "end_header\n";
}

/// Packs rows behind one another.
class RowPacker {
 public:
  explicit RowPacker(const RowLayout& layout) : layout_(layout) {}
  void add(const std::array<double, 3>& position, const std::array<double, 3>& normal,
           const std::array<float, 3>& colour, float confidence = 0) {
    for (const double c : position) {
      if (layout_.double_positions)
        append_little(bytes_, c);
      else
        append_little(bytes_, static_cast<float>(c));
    }
    for (const double c : normal) append_little(bytes_, static_cast<float>(c));
    if (layout_.colours)
      for (const float c : colour)
        append_little(bytes_, static_cast<std::uint8_t>(std::lround(std::clamp(c, 0.0F, 255.0F))));
    if (layout_.confidence) append_little(bytes_, confidence);
  }
  void reserve(std::size_t rows) { bytes_.reserve(rows * 43); }
  [[nodiscard]] const std::string& bytes() const { return bytes_; }

 private:
  RowLayout layout_;
  std::string bytes_;
};

}  // namespace lamina::scatter_detail
