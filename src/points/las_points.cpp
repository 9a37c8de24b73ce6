#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "points/binary_rows.h"
#include "points/las_header.h"
#include "points/las_records.h"
#include "points/point_columns.h"
#include "points/readers.h"
#include "points/select_points.h"

namespace lamina {
namespace {

/// A standard value that is worth carrying only if some point has it.
struct Candidate {
  PointColumn column;
  float enough = 0;  ///< a value above decides all there is to know about it
  float highest = 0;
};

std::vector<Candidate> candidates(int point_format) {
  constexpr std::size_t kIntensity = 12;
  constexpr std::size_t kNir = 36;
  constexpr float kLargest8Bit = 255;
  std::vector<Candidate> list{{{"intensity", ScalarType::uint16, kIntensity}}};
  if (const std::size_t colour = las_colour_offset(point_format); colour != 0) {
    list.push_back({{"red", ScalarType::uint16, colour}, kLargest8Bit});
    list.push_back({{"green", ScalarType::uint16, colour + 2}, kLargest8Bit});
    list.push_back({{"blue", ScalarType::uint16, colour + 4}, kLargest8Bit});
  }
  if (point_format == 8 || point_format == 10) list.push_back({{"nir", ScalarType::uint16, kNir}});
  return list;
}

bool holds_colour(const Candidate& c) {
  return c.enough > 0;
}

/// The bytes of a record that the columns take.
laz::WantedBytes bytes_of(const std::vector<PointColumn>& columns, std::size_t record_bytes) {
  laz::WantedBytes wanted(record_bytes, false);
  for (const PointColumn& c : columns) {
    for (std::size_t i = 0; i < static_cast<std::size_t>(byte_size(c.type)); ++i) wanted[c.offset + i] = true;
  }
  return wanted;
}

/// Where a value stands in a record that no attribute is made of: `bits` of it, 0 for all.
struct HiddenField {
  std::string_view name;
  ScalarType type;
  std::size_t offset;
  unsigned shift = 0, bits = 0;
  double scale = 1;
};

std::vector<HiddenField> hidden_fields(int point_format) {
  constexpr double kAngleStep = 0.006;
  if (point_format >= 6) {
    return {{"return_number", ScalarType::uint8, 14, 0, 4},
            {"number_of_returns", ScalarType::uint8, 14, 4, 4},
            {"classification", ScalarType::uint8, 16},
            {"user_data", ScalarType::uint8, 17},
            {"scan_angle", ScalarType::int16, 18, 0, 0, kAngleStep},
            {"point_source", ScalarType::uint16, 20},
            {"gps_time", ScalarType::float64, 22}};
  }
  std::vector<HiddenField> fields{{"return_number", ScalarType::uint8, 14, 0, 3},
                                  {"number_of_returns", ScalarType::uint8, 14, 3, 3},
                                  {"classification", ScalarType::uint8, 15, 0, 5},
                                  {"scan_angle", ScalarType::int8, 16},
                                  {"user_data", ScalarType::uint8, 17},
                                  {"point_source", ScalarType::uint16, 18}};
  if (point_format == 1 || point_format >= 3) fields.push_back({"gps_time", ScalarType::float64, 20});
  return fields;
}

/// What all points of a file have.
struct LasCensus {
  std::vector<Candidate> values;
  std::array<std::uint64_t, 256> classes{};  ///< how many points each has
};

/// Whether more points can tell anything of a candidate.
bool is_open(const Candidate& candidate, const std::vector<Candidate>& all) {
  if (!holds_colour(candidate)) return candidate.highest == 0;
  return std::none_of(all.begin(), all.end(),
                      [](const Candidate& c) { return holds_colour(c) && c.highest > c.enough; });
}

/// Reads all records once. Values are looked at until they are decided: in the first block, mostly, and to the end
/// where they are all small.
class CensusTaker {
 public:
  CensusTaker(const LasRecords& records, const LasHeader& header)
      : records_(records), record_bytes_(header.record_bytes), census_{candidates(header.point_format)} {
    for (const HiddenField& field : hidden_fields(header.point_format)) {
      if (field.name == "classification") class_ = field;
    }
  }

  LasCensus take() {
    constexpr std::uint64_t kAtOnce = 64;
    std::uint64_t blocks = 1;
    for (std::uint64_t first = 0; first < records_.count(); first += blocks * kBlock, blocks = kAtOnce) {
      choose_columns();
      tbb::parallel_for(std::uint64_t{0}, blocks, [&](std::uint64_t i) { look(first + i * kBlock); });
    }
    return std::move(census_);
  }

 private:
  static constexpr std::size_t kBlock = 1 << 14;

  void choose_columns() {
    columns_ = {{"classification", class_.type, class_.offset}};
    open_.clear();
    for (std::size_t k = 0; k < census_.values.size(); ++k) {
      if (!is_open(census_.values[k], census_.values)) continue;
      columns_.push_back(census_.values[k].column);
      open_.push_back(k);
    }
    wanted_ = bytes_of(columns_, record_bytes_);
  }

  void look(std::uint64_t first) {
    if (first >= records_.count()) return;
    const RowRange rows{first, static_cast<std::size_t>(std::min<std::uint64_t>(kBlock, records_.count() - first))};
    std::vector<std::vector<float>> values(columns_.size(), std::vector<float>(rows.count));
    std::vector<ColumnTarget> targets;
    targets.reserve(values.size());
    for (auto& v : values) targets.push_back({.narrow = v.data()});
    records_.read(rows, wanted_, [&](const std::byte* bytes, std::size_t at, std::size_t count) {
      convert_rows({0, record_bytes_, false}, columns_, bytes, at, count, targets);
    });
    std::array<std::uint64_t, 256> classes{};
    const unsigned mask = class_.bits == 0 ? 0xFF : (1U << class_.bits) - 1;
    for (const float v : values[0]) ++classes.at(static_cast<unsigned>(v) & mask);
    const std::lock_guard lock(mutex_);
    for (std::size_t k = 0; k < classes.size(); ++k) census_.classes.at(k) += classes.at(k);
    for (std::size_t k = 0; k < open_.size(); ++k) {
      float& highest = census_.values[open_[k]].highest;
      highest = std::max(highest, *std::max_element(values[k + 1].begin(), values[k + 1].end()));
    }
  }

  const LasRecords& records_;
  std::size_t record_bytes_;
  LasCensus census_;
  HiddenField class_{};
  std::vector<PointColumn> columns_;  ///< the class, and the values that are open
  std::vector<std::size_t> open_;
  laz::WantedBytes wanted_;
  std::mutex mutex_;
};

class LasPoints final : public PointSource, public HiddenValues {
 public:
  LasPoints(InputFile file, const std::string& path, const PointSelection& selection)
      : file_(std::move(file)), header_(read_las_header(file_)), records_(open_las_records(file_, header_, selection)) {
    info_.path = path;
    info_.count = records_->count();
    info_.random_access = true;
    info_.geographic = header_.geographic;
    info_.crs = header_.crs;
    for (std::size_t k = 0; k < 3; ++k) columns_.push_back({std::string(1, "xyz"[k]), ScalarType::int32, 4 * k});
    add_standard_values();
    info_.from_above = is_from_above();
    add_extras();
    give_roles(columns_, info_, file_.name, "value");
    declare_types();
    wanted_ = bytes_of(columns_, header_.record_bytes);
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
    for (const Scaled& s : scaled_) {
      const ColumnTarget& target = targets[s.column];
      for (std::size_t i = 0; i < rows.count && target.narrow != nullptr; ++i) {
        target.narrow[i] = static_cast<float>(double{target.narrow[i]} * s.scale + s.shift);
      }
      for (std::size_t i = 0; i < rows.count && target.wide != nullptr; ++i) {
        target.wide[i] = target.wide[i] * s.scale + s.shift;
      }
    }
    round_exact_attributes(out);
  }

  [[nodiscard]] std::vector<std::uint64_t> class_counts() const override { return classes_; }

  [[nodiscard]] bool has_hidden(std::string_view name) const override {
    const std::vector<HiddenField> fields = hidden_fields(header_.point_format);
    return std::any_of(fields.begin(), fields.end(), [&](const HiddenField& f) { return f.name == name; });
  }

  void read_hidden(const std::vector<std::string>& names, RowRange rows,
                   std::vector<std::vector<double>>& values) const override {
    std::vector<HiddenField> fields;
    std::vector<PointColumn> columns;
    for (const std::string& name : names) {
      for (const HiddenField& field : hidden_fields(header_.point_format)) {
        if (field.name == name) fields.push_back(field);
      }
      columns.push_back({name, fields.back().type, fields.back().offset});
    }
    values.assign(names.size(), std::vector<double>(rows.count));
    std::vector<ColumnTarget> targets;
    targets.reserve(values.size());
    for (std::vector<double>& v : values) targets.push_back({.wide = v.data()});
    records_->read(rows, bytes_of(columns, header_.record_bytes),
                   [&](const std::byte* bytes, std::size_t at, std::size_t n) {
                     convert_rows({0, header_.record_bytes, false}, columns, bytes, at, n, targets);
                   });
    for (std::size_t k = 0; k < fields.size(); ++k) {
      const HiddenField& field = fields[k];
      if (field.bits == 0 && field.scale == 1) continue;
      for (double& v : values[k]) {
        if (field.bits != 0) v = static_cast<unsigned>(v) >> field.shift & ((1U << field.bits) - 1);
        v *= field.scale;
      }
    }
  }

 private:
  struct Scaled {
    std::size_t column;
    double scale, shift;
  };

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

  void add_standard_values() {
    LasCensus census = CensusTaker(*records_, header_).take();
    classes_.assign(census.classes.begin(), census.classes.end());
    const std::vector<Candidate>& list = census.values;
    float brightest = 0;
    for (const Candidate& c : list) {
      if (holds_colour(c)) brightest = std::max(brightest, c.highest);
    }
    eight_bit_colours_ = brightest > 0 && brightest <= 255;
    for (const Candidate& c : list) {
      if ((holds_colour(c) ? brightest : c.highest) > 0) columns_.push_back(c.column);
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
    for (const Scaled& s : scaled_) {
      const PointColumn& column = columns_[s.column];
      if (column.role != Role::attribute) continue;
      info_.attributes[column.attribute].type = fits_float(column.type) ? ScalarType::float32 : ScalarType::float64;
    }
  }

  InputFile file_;
  LasHeader header_;
  std::unique_ptr<LasRecords> records_;
  std::vector<PointColumn> columns_;
  laz::WantedBytes wanted_;
  std::vector<std::uint64_t> classes_;  ///< points by class
  std::vector<Scaled> scaled_;
  bool eight_bit_colours_ = false;
};

}  // namespace

std::unique_ptr<PointSource> open_las(InputFile file, const std::string& path, const PointSelection& selection) {
  return std::make_unique<LasPoints>(std::move(file), path, selection);
}

}  // namespace lamina
