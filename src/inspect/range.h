// The range of a column, piece by piece.
#pragma once
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "lamina/info.h"

namespace lamina::inspect {

class RangeOf {
 public:
  RangeOf(std::string name, ScalarType type) : range_{std::move(name), type} {}

  template <class T>
  void add(T value) {
    if (!std::isfinite(value)) {
      ++range_.not_finite;
      return;
    }
    const auto v = static_cast<double>(value);
    if (range_.values++ == 0) range_.low = range_.high = first_ = v;
    range_.low = std::min(range_.low, v);
    range_.high = std::max(range_.high, v);
    sum_ += v - first_;  // about the first value: georeferenced coordinates keep their digits
  }
  template <class T>
  void add_all(const std::vector<T>& values) {
    for (const T value : values) add(value);
  }
  [[nodiscard]] ColumnRange result() const {
    ColumnRange out = range_;
    if (out.values > 0) {
      out.mean = std::clamp(first_ + sum_ / static_cast<double>(out.values), out.low, out.high);
    }
    return out;
  }

 private:
  ColumnRange range_;
  double first_ = 0, sum_ = 0;
};

}  // namespace lamina::inspect
