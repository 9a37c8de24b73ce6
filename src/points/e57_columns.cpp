#include "points/e57_columns.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

namespace lamina {
namespace {

using e57::Field;

std::optional<std::size_t> find_field(const e57::Scan& scan, std::string_view name) {
  for (std::size_t i = 0; i < scan.fields.size(); ++i) {
    if (scan.fields[i].name == name && scan.fields[i].kind != Field::Kind::text) return i;
  }
  return std::nullopt;
}

bool is_integer(const Field& field) {
  return field.kind == Field::Kind::integer;
}

/// What a field's limits are by themselves: those that were written down, else what integers can be.
e57::Limits limits_of(const Field& field, const e57::Limits& given) {
  if (given && given->second > given->first) return given;
  if (!is_integer(field) || field.maximum <= field.minimum) return std::nullopt;
  return std::pair{static_cast<double>(field.minimum), static_cast<double>(field.maximum)};
}

/// The smallest type that holds the field's values.
ScalarType type_of(const Field& field) {
  if (field.kind == Field::Kind::single_float) return ScalarType::float32;
  if (!is_integer(field)) return ScalarType::float64;
  constexpr std::array kTypes{std::pair{ScalarType::uint8, std::pair{0LL, 255LL}},
                              std::pair{ScalarType::int8, std::pair{-128LL, 127LL}},
                              std::pair{ScalarType::uint16, std::pair{0LL, 65535LL}},
                              std::pair{ScalarType::int16, std::pair{-32768LL, 32767LL}},
                              std::pair{ScalarType::uint32, std::pair{0LL, 4294967295LL}},
                              std::pair{ScalarType::int32, std::pair{-2147483648LL, 2147483647LL}}};
  for (const auto& [type, range] : kTypes) {
    if (field.minimum >= range.first && field.maximum <= range.second) return type;
  }
  return ScalarType::float64;
}

class ColumnsBuilder {
 public:
  ColumnsBuilder(const e57::Scan& scan, const e57::PagedFile& file) : scan_(scan), file_(file) {}

  E57Columns build() {
    add_positions();
    add_normals();
    add_intensity();
    add_colours();
    add_extensions();
    return std::move(out_);
  }

 private:
  E57Column& add(std::size_t field, std::string name, ScalarType type) {
    E57Column column{field, {}};
    column.column.name = std::move(name);
    column.column.type = type;
    out_.columns.push_back(std::move(column));
    return out_.columns.back();
  }

  std::optional<std::size_t> flag(std::string_view name) {
    const auto field = find_field(scan_, name);
    if (!field) return std::nullopt;
    out_.flags.push_back({*field});
    return out_.flags.size() - 1;
  }

  bool add_triple(const std::array<const char*, 3>& fields, const std::array<const char*, 3>& names, ScalarType type) {
    std::array<std::size_t, 3> found{};
    for (std::size_t k = 0; k < 3; ++k) {
      const auto field = find_field(scan_, fields[k]);
      if (!field) return false;
      found[k] = *field;
    }
    for (std::size_t k = 0; k < 3; ++k) add(found[k], names[k], type);
    return true;
  }

  void add_positions() {
    constexpr std::array kNames{"x", "y", "z"};
    if (add_triple({"cartesianX", "cartesianY", "cartesianZ"}, kNames, ScalarType::float64)) {
      out_.invalid = flag("cartesianInvalidState");
    } else if (add_triple({"sphericalRange", "sphericalAzimuth", "sphericalElevation"}, kNames, ScalarType::float64)) {
      out_.invalid = flag("sphericalInvalidState");
      out_.by_angles = true;
    } else {
      file_.refuse(fmt::format("the scan at byte {} has neither Cartesian nor spherical coordinates",
                               e57::file_offset(scan_.section)));
    }
    out_.double_precision = std::any_of(out_.columns.begin(), out_.columns.end(), [&](const E57Column& c) {
      return scan_.fields[c.field].kind != Field::Kind::single_float;
    });
  }

  void add_normals() {
    add_triple({"nor:normalX", "nor:normalY", "nor:normalZ"}, {"nx", "ny", "nz"}, ScalarType::float32);
  }

  void add_intensity() {
    const auto field = find_field(scan_, "intensity");
    if (!field) return;
    const Field& f = scan_.fields[*field];
    const e57::Limits limits = limits_of(f, scan_.intensity);
    const ScalarType type = type_of(f);
    const auto fits = [&](double full) { return limits && *limits == std::pair{0.0, full}; };
    const bool own = !scan_.intensity || (type == ScalarType::uint8 && fits(255)) ||
                     (type == ScalarType::uint16 && fits(65535)) || (!is_integer(f) && fits(1)) || !limits;
    E57Column& column = add(*field, "intensity", own ? type : ScalarType::float32);
    if (!own) {
      column.scale = 1 / (limits->second - limits->first);
      column.shift = -limits->first * column.scale;
    }
    const std::size_t at = out_.columns.size() - 1;
    const auto invalid = flag("isIntensityInvalid");
    out_.columns[at].flag = invalid;
  }

  void add_colours() {
    const std::size_t before = out_.columns.size();
    if (!add_triple({"colorRed", "colorGreen", "colorBlue"}, {"red", "green", "blue"}, ScalarType::float32)) return;
    const auto invalid = flag("isColorInvalid");
    for (std::size_t k = 0; k < 3; ++k) {
      E57Column& column = out_.columns[before + k];
      column.flag = invalid;
      take_colour_limits(column, scan_.colour[k]);
    }
  }

  /// Colours of up to 255 are taken as they are: some writers give the range of their data as the limits.
  void take_colour_limits(E57Column& column, const e57::Limits& given) const {
    const Field& f = scan_.fields[column.field];
    const e57::Limits limits = limits_of(f, given);
    column.column.type = type_of(f);
    if (!limits || limits->first < 0) return;
    if (limits->second <= 1 && !is_integer(f)) {
      column.column.type = f.kind == Field::Kind::double_float ? ScalarType::float64 : ScalarType::float32;
    } else if (limits->second <= 255) {
      column.column.type = ScalarType::uint8;
    } else {
      column.column.type = ScalarType::uint16;
      column.scale = 65535 / limits->second;
    }
    column.whole = column.scale != 1;
  }

  void add_extensions() {
    for (std::size_t i = 0; i < scan_.fields.size(); ++i) {
      const Field& field = scan_.fields[i];
      const std::size_t colon = field.name.find(':');
      if (colon == std::string::npos || field.kind == Field::Kind::text) continue;
      std::string name = field.name.substr(colon + 1);
      const auto is_taken = [&](const E57Column& c) { return c.field == i || c.column.name == name; };
      if (name.empty() || std::any_of(out_.columns.begin(), out_.columns.end(), is_taken)) continue;
      // Half a normal is none.
      if (name == "nx" || name == "ny" || name == "nz") continue;
      add(i, std::move(name), type_of(field));
    }
  }

  const e57::Scan& scan_;
  const e57::PagedFile& file_;
  E57Columns out_;
};

}  // namespace

E57Columns e57_columns(const e57::Scan& scan, const e57::PagedFile& file) {
  return ColumnsBuilder(scan, file).build();
}

std::optional<std::array<std::size_t, 2>> e57_grid_fields(const e57::Scan& scan) {
  const auto row = find_field(scan, "rowIndex");
  const auto column = find_field(scan, "columnIndex");
  if (!row || !column) return std::nullopt;
  return std::array{*row, *column};
}

namespace {

/// Scanners see a good part of the places; more than so many without a point are no scanner's.
constexpr std::uint64_t kMostPlaces = 64;

}  // namespace

E57GridOrder::Place E57GridOrder::place(const Order& order, std::int64_t row, std::int64_t column) {
  const std::int64_t line = order.by_columns ? column : row;
  const std::int64_t at = order.by_columns ? row : column;
  return {order.lines_down ? -line : line, order.places_down ? -at : at};
}

void E57GridOrder::add(std::int64_t row, std::int64_t column) {
  if (points_++ == 0) low_ = high_ = {row, column};
  low_ = {std::min(low_[0], row), std::min(low_[1], column)};
  high_ = {std::max(high_[0], row), std::max(high_[1], column)};
  for (Order& order : orders_) {
    if (points_ > 1 && !(place(order, last_[0], last_[1]) < place(order, row, column))) order.possible = false;
  }
  last_ = {row, column};
}

std::shared_ptr<ScanGrid> E57GridOrder::grid() {
  const auto found = std::find_if(orders_.begin(), orders_.end(), [](const Order& order) { return order.possible; });
  if (points_ < 2 || found == orders_.end()) return nullptr;
  order_ = *found;
  const Place a = place(order_, low_[0], low_[1]);
  const Place b = place(order_, high_[0], high_[1]);
  first_ = {std::min(a[0], b[0]), std::min(a[1], b[1])};
  const auto lines = static_cast<std::uint64_t>(std::max(a[0], b[0]) - first_[0] + 1);
  length_ = static_cast<std::uint64_t>(std::max(a[1], b[1]) - first_[1] + 1);
  if (lines * length_ > kMostPlaces * points_) return nullptr;
  return std::make_shared<ScanGrid>(length_);
}

void E57GridOrder::mark(std::int64_t row, std::int64_t column, ScanGrid& grid) {
  const Place at = place(order_, row, column);
  const std::uint64_t index =
      static_cast<std::uint64_t>(at[0] - first_[0]) * length_ + static_cast<std::uint64_t>(at[1] - first_[1]);
  for (; marked_ < index; ++marked_) grid.add(false);
  grid.add(true);
  ++marked_;
}

}  // namespace lamina
