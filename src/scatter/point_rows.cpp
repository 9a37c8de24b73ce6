#include "scatter/point_rows.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/little_endian.h"

namespace lamina::scatter_detail {

std::string ply_header(const RowLayout& layout, std::uint64_t count, const std::vector<std::string>& comments) {
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

void RowPacker::add(const std::array<double, 3>& position, const std::array<double, 3>& normal,
                    const std::array<float, 3>& colour, float confidence) {
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

}  // namespace lamina::scatter_detail
