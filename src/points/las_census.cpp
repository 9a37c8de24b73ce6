#include "points/las_census.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <mutex>
#include <utility>

#include "points/binary_rows.h"
#include "points/las_fields.h"

namespace lamina {
namespace {

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

}  // namespace

LasCensus take_las_census(const LasRecords& records, const LasHeader& header, bool fields) {
  return CensusTaker(records, header, fields).take();
}

laz::WantedBytes las_bytes_of(const std::vector<PointColumn>& columns, std::size_t record_bytes) {
  laz::WantedBytes wanted(record_bytes, false);
  for (const PointColumn& c : columns) {
    for (std::size_t i = 0; i < static_cast<std::size_t>(byte_size(c.type)); ++i) wanted[c.offset + i] = true;
  }
  return wanted;
}

}  // namespace lamina
