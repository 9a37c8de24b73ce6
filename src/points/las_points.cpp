// Points of LAS, and of LAZ, whose chunks are decoded as they are wanted.
#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "points/formats.h"
#include "points/las.h"
#include "points/point_columns.h"

namespace lamina {
namespace {

// What all points have, read once before the points are.

/// A standard value that is worth carrying only if some point has it.
struct LasCandidate {
  PointColumn column;
  double enough = 0;   ///< a size above decides all there is to know about it
  unsigned mask = 0;   ///< of the bits that count; 0: all
  double highest = 0;  ///< the largest size found

  [[nodiscard]] bool is_colour() const { return enough > 0; }
};

struct LasCensus {
  std::vector<LasCandidate> values;
  std::array<std::uint64_t, 256> classes{};  ///< how many points each has
};

std::vector<LasCandidate> candidates(int point_format, bool fields) {
  constexpr std::size_t kIntensity = 12, kNir = 36;
  constexpr double kLargest8Bit = 255;
  std::vector<LasCandidate> list{{{"intensity", ScalarType::uint16, kIntensity}}};
  if (const std::size_t colour = las_colour_offset(point_format); colour != 0) {
    list.push_back({{"red", ScalarType::uint16, colour}, kLargest8Bit});
    list.push_back({{"green", ScalarType::uint16, colour + 2}, kLargest8Bit});
    list.push_back({{"blue", ScalarType::uint16, colour + 4}, kLargest8Bit});
  }
  if (point_format == 8 || point_format == 10) list.push_back({{"nir", ScalarType::uint16, kNir}});
  if (!fields) return list;
  for (const LasField& f : las_fields(point_format)) {
    const unsigned mask = f.bits == 0 ? 0 : ((1U << f.bits) - 1) << f.shift;
    list.push_back({{std::string(f.name), f.stored, f.offset}, 0, mask});
  }
  return list;
}

/// Whether more points can tell anything of a candidate.
bool is_open(const LasCandidate& candidate, const std::vector<LasCandidate>& all) {
  if (!candidate.is_colour()) return candidate.highest == 0;
  return std::none_of(all.begin(), all.end(),
                      [](const LasCandidate& c) { return c.is_colour() && c.highest > c.enough; });
}

double largest_size(const std::vector<float>& values, unsigned mask) {
  double largest = 0;
  for (const float v : values) {
    const double size = mask == 0 ? std::abs(double{v}) : static_cast<double>(static_cast<unsigned>(v) & mask);
    largest = std::max(largest, size);
  }
  return largest;
}

/// The bytes of a record that the columns take.
laz::WantedBytes las_bytes_of(const std::vector<PointColumn>& columns, std::size_t record_bytes) {
  laz::WantedBytes wanted(record_bytes, false);
  for (const PointColumn& c : columns) {
    for (std::size_t i = 0; i < static_cast<std::size_t>(byte_size(c.type)); ++i) wanted[c.offset + i] = true;
  }
  return wanted;
}

class CensusTaker {
 public:
  CensusTaker(const LasRecords& records, const LasHeader& header, bool fields)
      : records_(records),
        record_bytes_(header.record_bytes),
        census_{candidates(header.point_format, fields)},
        all_fields_(las_fields(header.point_format)),
        class_(*std::find_if(all_fields_.begin(), all_fields_.end(),
                             [](const LasField& f) { return f.name == "classification"; })) {}

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
    columns_ = {{"classification", class_.stored, class_.offset}};
    open_.clear();
    for (std::size_t k = 0; k < census_.values.size(); ++k) {
      if (!is_open(census_.values[k], census_.values)) continue;
      columns_.push_back(census_.values[k].column);
      open_.push_back(k);
    }
    wanted_ = las_bytes_of(columns_, record_bytes_);
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
    for (const float v : values[0]) ++classes.at(static_cast<std::size_t>(class_.value(double{v})));
    std::vector<double> largest;
    for (std::size_t k = 0; k < open_.size(); ++k) {
      largest.push_back(largest_size(values[k + 1], census_.values[open_[k]].mask));
    }
    const std::lock_guard lock(mutex_);
    for (std::size_t k = 0; k < classes.size(); ++k) census_.classes.at(k) += classes.at(k);
    for (std::size_t k = 0; k < open_.size(); ++k) {
      double& highest = census_.values[open_[k]].highest;
      highest = std::max(highest, largest[k]);
    }
  }

  const LasRecords& records_;
  std::size_t record_bytes_;
  LasCensus census_;
  std::vector<LasField> all_fields_;
  LasField class_;
  std::vector<PointColumn> columns_;  ///< the class, and the values that are open
  std::vector<std::size_t> open_;
  laz::WantedBytes wanted_;
  std::mutex mutex_;
};

/// Reads all records once: values until they are decided, in the first block mostly, and to the end where they are all
/// small. The candidates are intensity, colours and infrared, and with `fields` all of las_fields(), too.
LasCensus take_las_census(const LasRecords& records, const LasHeader& header, bool fields) {
  return CensusTaker(records, header, fields).take();
}

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
