// How LAS 1.4 files of ours are laid out: header, description of extra bytes, rows.
#pragma once
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "lamina/points_writer.h"

namespace lamina {

/// Steps of the integer coordinates along an axis.
struct LasAxis {
  double low = 0, high = 0;      ///< of the points
  double scale = 1, offset = 0;  ///< coordinate = integer * scale + offset
};

/// The smallest power of ten that lets 32 bits span [low, high], but no finer than doubles are there.
LasAxis choose_steps(double low, double high);

struct LasExtraColumn {
  std::string name;
  ScalarType type = ScalarType::float32;
};

class LasLayout {
 public:
  /// Throws Error(internal) for names that do not fit.
  explicit LasLayout(const PointColumns& columns);

  [[nodiscard]] bool has_colours() const { return colours_; }
  [[nodiscard]] std::size_t record_bytes() const { return record_bytes_; }
  /// Header and records before the points.
  [[nodiscard]] std::string header(const std::array<LasAxis, 3>& axes, std::uint64_t count) const;
  /// Rows [first, first + n) as point records.
  void encode(const SampleBatch& batch, const std::array<LasAxis, 3>& axes, std::size_t first, std::size_t n,
              std::byte* out) const;

 private:
  PointColumns columns_;
  bool colours_ = false;
  std::array<std::size_t, 3> colour_{};  ///< attributes red, green, blue
  int intensity_ = -1;                   ///< its attribute, -1: none
  std::vector<std::size_t> others_;      ///< attributes that are extra bytes
  std::vector<LasExtraColumn> extras_;   ///< all extra bytes
  std::size_t record_bytes_ = 0;
};

}  // namespace lamina
