#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "points/binary_rows.h"
#include "points/las_census.h"
#include "points/las_fields.h"
#include "points/las_header.h"
#include "points/las_records.h"
#include "points/point_columns.h"
#include "points/readers.h"
#include "points/select_points.h"

namespace lamina {
namespace {

class LasPoints final : public PointSource, public HiddenValues {
 public:
  LasPoints(InputFile file, const std::string& path, const PointSettings& settings)
      : file_(std::move(file)),
        header_(read_las_header(file_)),
        fields_(las_fields(header_.point_format)),
        records_(open_las_records(file_, header_, settings.select)) {
    info_.path = path;
    info_.count = records_->count();
    info_.random_access = true;
    info_.geographic = header_.geographic;
    info_.crs = header_.crs;
    for (std::size_t k = 0; k < 3; ++k) columns_.push_back({std::string(1, "xyz"[k]), ScalarType::int32, 4 * k});
    add_standard_values(settings.all_fields);
    info_.from_above = is_from_above();
    add_extras();
    give_roles(columns_, info_, file_.name, "value");
    declare_types();
    wanted_ = las_bytes_of(columns_, header_.record_bytes);
    info_.double_precision = true;
    info_.remarks.insert(info_.remarks.end(), records_->remarks().begin(), records_->remarks().end());
    if (header_.uncounted > 0) {
      info_.remarks.push_back(fmt::format("{}: the header counts {} points; behind them is room for {} more, left out",
                                          file_.name, header_.count, header_.uncounted));
    }
  }

  void read(std::uint64_t first, std::size_t count, SampleBatch& out) override {
    const RowRange rows = rows_there(info_, first, count);
    const std::vector<ColumnTarget> targets = prepare_batch(info_, columns_, rows, out);
    records_->read(rows, wanted_, [&](const std::byte* bytes, std::size_t at, std::size_t n) {
      convert_rows({0, header_.record_bytes, false}, columns_, bytes, at, n, targets);
    });
    std::size_t axis = 0;
    for (std::vector<double>* v : {&out.x, &out.y, &out.z}) {
      for (double& value : *v) value = value * header_.scale[axis] + header_.offset[axis];
      ++axis;
    }
    const auto change = [&](std::size_t column, const auto& value) {
      const ColumnTarget& target = targets[column];
      for (std::size_t i = 0; i < rows.count && target.narrow != nullptr; ++i) {
        target.narrow[i] = static_cast<float>(value(double{target.narrow[i]}));
      }
      for (std::size_t i = 0; i < rows.count && target.wide != nullptr; ++i) target.wide[i] = value(target.wide[i]);
    };
    for (const Scaled& s : scaled_) change(s.column, [&](double v) { return v * s.scale + s.shift; });
    for (const Packed& p : packed_) change(p.column, [&](double v) { return p.field.value(v); });
    round_exact_attributes(out);
  }

  [[nodiscard]] std::vector<std::uint64_t> class_counts() const override { return classes_; }

  [[nodiscard]] bool has_hidden(std::string_view name) const override { return find_field(name) != nullptr; }

  void read_hidden(const std::vector<std::string>& names, RowRange rows,
                   std::vector<std::vector<double>>& values) const override {
    std::vector<PointColumn> columns;
    for (const std::string& name : names) {
      const LasField& field = *find_field(name);
      columns.push_back({name, field.stored, field.offset});
    }
    values.assign(names.size(), std::vector<double>(rows.count));
    std::vector<ColumnTarget> targets;
    targets.reserve(values.size());
    for (std::vector<double>& v : values) targets.push_back({.wide = v.data()});
    records_->read(rows, las_bytes_of(columns, header_.record_bytes),
                   [&](const std::byte* bytes, std::size_t at, std::size_t n) {
                     convert_rows({0, header_.record_bytes, false}, columns, bytes, at, n, targets);
                   });
    for (std::size_t k = 0; k < names.size(); ++k) {
      const LasField& field = *find_field(names[k]);
      if (field.is_stored_as_it_is()) continue;
      for (double& v : values[k]) v = field.value(v);
    }
  }

 private:
  /// Columns whose values are not those of the record's bytes.
  struct Scaled {
    std::size_t column;
    double scale, shift;
  };
  struct Packed {
    std::size_t column;
    LasField field;
  };

  [[nodiscard]] const LasField* find_field(std::string_view name) const {
    const auto found = std::find_if(fields_.begin(), fields_.end(), [&](const LasField& f) { return f.name == name; });
    return found == fields_.end() ? nullptr : &*found;
  }

  /// Pulses of several returns, or points classified as ground or buildings, in a box twice as wide as high; or, where
  /// these were lost on the way, a georeferenced hectare four times as wide as high.
  [[nodiscard]] bool is_from_above() const {
    constexpr std::size_t kGround = 2, kBuilding = 6;
    const auto extent = [this](std::size_t k) { return header_.high[k] - header_.low[k]; };
    const bool told = header_.several_returns || classes_[kGround] > 0 || classes_[kBuilding] > 0;
    const double width = std::min(extent(0), extent(1));
    constexpr double kWide = 100;
    if (told) return 2 * extent(2) <= width;
    return !header_.crs.empty() && width >= kWide && 4 * extent(2) <= width;
  }

  void add_standard_values(bool all_fields) {
    LasCensus census = take_las_census(*records_, header_, all_fields);
    classes_.assign(census.classes.begin(), census.classes.end());
    double brightest = 0;
    for (const LasCandidate& c : census.values) {
      if (c.is_colour()) brightest = std::max(brightest, c.highest);
    }
    eight_bit_colours_ = brightest > 0 && brightest <= 255;
    for (const LasCandidate& c : census.values) {
      if ((c.is_colour() ? brightest : c.highest) == 0) continue;
      const LasField* field = find_field(c.column.name);
      if (field != nullptr && !field->is_stored_as_it_is()) packed_.push_back({columns_.size(), *field});
      columns_.push_back(c.column);
    }
    if (eight_bit_colours_) {
      info_.remarks.push_back(fmt::format("{}: no colour is above 255: taken as 8-bit colours", file_.name));
    }
  }

  void add_extras() {
    for (const LasExtra& extra : header_.extras) {
      const bool taken =
          std::any_of(columns_.begin(), columns_.end(), [&](const PointColumn& c) { return c.name == extra.name; });
      if (taken) continue;
      const bool plain = extra.scale == 1 && extra.shift == 0;
      if (!plain) scaled_.push_back({columns_.size(), extra.scale, extra.shift});
      columns_.push_back({extra.name, extra.type, extra.offset});
    }
  }

  /// What the values are once read, where the file stores them as something else.
  void declare_types() {
    for (const PointColumn& column : columns_) {
      if (column.role != Role::attribute) continue;
      const bool colour = column.name == "red" || column.name == "green" || column.name == "blue";
      if (eight_bit_colours_ && colour) info_.attributes[column.attribute].type = ScalarType::uint8;
    }
    for (const Packed& p : packed_) info_.attributes[columns_[p.column].attribute].type = p.field.type();
    for (const Scaled& s : scaled_) {
      const PointColumn& column = columns_[s.column];
      if (column.role != Role::attribute) continue;
      info_.attributes[column.attribute].type = fits_float(column.type) ? ScalarType::float32 : ScalarType::float64;
    }
  }

  InputFile file_;
  LasHeader header_;
  std::vector<LasField> fields_;
  std::unique_ptr<LasRecords> records_;
  std::vector<PointColumn> columns_;
  laz::WantedBytes wanted_;
  std::vector<std::uint64_t> classes_;  ///< points by class
  std::vector<Scaled> scaled_;
  std::vector<Packed> packed_;
  bool eight_bit_colours_ = false;
};

}  // namespace

std::unique_ptr<PointSource> open_las(InputFile file, const std::string& path, const PointSettings& settings) {
  return std::make_unique<LasPoints>(std::move(file), path, settings);
}

}  // namespace lamina
