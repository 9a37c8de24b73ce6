#include "reconstruct/local_shift.h"

#include <fmt/format.h>

#include <cmath>

namespace lamina {

std::array<double, 3> local_shift(const Census& census) {
  const Eigen::Vector3d extent = census.high - census.low;
  const double power = std::floor(std::log10(extent.maxCoeff()));
  // Whole powers of ten are exact doubles, their inverses are not: fractions are made by dividing.
  const double whole = std::pow(10.0, std::abs(power));
  std::array<double, 3> shift{};
  for (int k = 0; k < 3; ++k) {
    const double middle = census.low[k] + 0.5 * extent[k];
    const double rounded = power < 0 ? std::round(middle * whole) / whole : std::round(middle / whole) * whole;
    shift[static_cast<std::size_t>(k)] = std::isfinite(rounded) ? rounded + 0.0 : 0.0;
  }
  return shift;
}

Frame shifted(const Frame& frame, const std::array<double, 3>& shift) {
  Frame out = frame;
  out.origin -= Eigen::Vector3d(shift[0], shift[1], shift[2]);
  return out;
}

std::string shift_text(const std::array<double, 3>& shift) {
  return fmt::format("{} {} {}", shift[0], shift[1], shift[2]);
}

}  // namespace lamina
