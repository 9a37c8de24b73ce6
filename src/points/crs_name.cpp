#include <algorithm>

#include "lamina/points.h"

namespace lamina {

std::string crs_name(const std::string& crs) {
  // The name is the first text in quotes; that of a compound system tells both of its parts.
  const std::size_t open = crs.find('"');
  if (open == std::string::npos) return crs;
  const std::size_t close = std::min(crs.find('"', open + 1), crs.size());
  return crs.substr(open + 1, close - open - 1);
}

}  // namespace lamina
