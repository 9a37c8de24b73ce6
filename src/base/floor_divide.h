// Exact floor division of fixed-point coordinates by one positive divisor, fast enough for every sample.
#pragma once
#include <cstdint>

namespace lamina {

/// floor((value - origin) / divisor) for int32 values, origin and divisor; divisor > 0. Half a step is added before
/// multiplying by the reciprocal, which keeps the quotient at least 1/(2 divisor) away from an integer: far more than
/// the rounding of a double, so the result is exact. Compiles to vector code in loops, which an integer division does
/// not.
class FloorDivider {
 public:
  explicit FloorDivider(std::int32_t divisor, std::int32_t origin = 0)
      : reciprocal_(1.0 / divisor), shift_(0.5 - static_cast<double>(origin)) {}
  /// The quotient must fit 32 bits: true for origin 0, and otherwise when |value - origin| / divisor does.
  [[nodiscard]] std::int32_t operator()(std::int32_t value) const {
    const double quotient = (static_cast<double>(value) + shift_) * reciprocal_;
    const auto truncated = static_cast<std::int32_t>(quotient);
    return truncated - static_cast<std::int32_t>(static_cast<double>(truncated) > quotient);
  }

 private:
  double reciprocal_;
  double shift_;
};

}  // namespace lamina
