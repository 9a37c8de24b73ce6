#include <fmt/format.h>

#include <algorithm>

#include "points/binary_rows.h"
#include "points/las_header.h"
#include "points/point_columns.h"
#include "points/readers.h"

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

/// Reads on until every candidate is decided: the first block, mostly, and the whole file where values are all small.
void look_for_values(const InputFile& file, const BinaryRows& rows, std::uint64_t count, std::vector<Candidate>& list) {
  constexpr std::size_t kBlock = 1 << 14;
  std::vector<PointColumn> columns;
  columns.reserve(list.size());
  for (const Candidate& c : list) columns.push_back(c.column);
  std::vector<std::vector<float>> values(list.size(), std::vector<float>(kBlock));
  std::vector<ColumnTarget> targets;
  targets.reserve(list.size());
  for (auto& v : values) targets.push_back({.narrow = v.data()});
  const auto undecided = [&] {
    const bool wide_colour = std::any_of(list.begin(), list.end(),
                                         [](const Candidate& c) { return holds_colour(c) && c.highest > c.enough; });
    return std::any_of(list.begin(), list.end(),
                       [&](const Candidate& c) { return holds_colour(c) ? !wide_colour : c.highest == 0; });
  };
  for (std::uint64_t first = 0; first < count && undecided(); first += kBlock) {
    const auto n = static_cast<std::size_t>(std::min<std::uint64_t>(kBlock, count - first));
    read_binary_rows(file, rows, columns, {first, n}, targets);
    for (std::size_t k = 0; k < list.size(); ++k) {
      const float* v = values[k].data();
      list[k].highest = std::max(list[k].highest, *std::max_element(v, v + n));
    }
  }
}

class LasPoints final : public PointSource {
 public:
  LasPoints(InputFile file, const std::string& path) : file_(std::move(file)), header_(read_las_header(file_)) {
    layout_ = {header_.data, header_.record_bytes, false};
    info_.path = path;
    info_.count = header_.count;
    info_.random_access = true;
    info_.geographic = header_.geographic;
    for (std::size_t k = 0; k < 3; ++k) columns_.push_back({std::string(1, "xyz"[k]), ScalarType::int32, 4 * k});
    add_standard_values();
    add_extras();
    give_roles(columns_, info_, file_.name, "value");
    declare_types();
    info_.double_precision = true;
    if (header_.uncounted > 0) {
      info_.remarks.push_back(fmt::format("{}: the header counts {} points; behind them is room for {} more, left out",
                                          file_.name, header_.count, header_.uncounted));
    }
  }

  void read(std::uint64_t first, std::size_t count, SampleBatch& out) override {
    const RowRange rows = rows_there(info_, first, count);
    const std::vector<ColumnTarget> targets = prepare_batch(info_, columns_, rows, out);
    read_binary_rows(file_, layout_, columns_, rows, targets);
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

 private:
  struct Scaled {
    std::size_t column;
    double scale, shift;
  };

  void add_standard_values() {
    std::vector<Candidate> list = candidates(header_.point_format);
    look_for_values(file_, layout_, header_.count, list);
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
  BinaryRows layout_;
  std::vector<PointColumn> columns_;
  std::vector<Scaled> scaled_;
  bool eight_bit_colours_ = false;
};

}  // namespace

std::unique_ptr<PointSource> open_las(InputFile file, const std::string& path) {
  return std::make_unique<LasPoints>(std::move(file), path);
}

}  // namespace lamina
