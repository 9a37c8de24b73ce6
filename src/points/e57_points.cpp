// Points of E57 files: each scan is a source of its own, in its pose, and all of them are one.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "e57/e57.h"
#include "lamina/points.h"
#include "points/e57_columns.h"
#include "points/formats.h"
#include "points/point_columns.h"
#include "points/scans.h"

namespace lamina {
namespace {

constexpr std::size_t kE57Block = 1 << 13;  ///< records taken apart at once

/// The points of a scan where its scanner saw them. Rows are the records that are not marked as invalid.
class E57Scan final : public PointSource {
 public:
  E57Scan(const std::string& path, std::shared_ptr<const e57::PagedFile> file, const e57::Scan& scan)
      : streams_(std::move(file), scan), layout_(e57_columns(streams_.scan(), streams_.file())) {
    info_.path = path;
    info_.random_access = true;
    for (const E57Column& column : layout_.columns) columns_.push_back(column.column);
    give_roles(columns_, info_, streams_.file().name(), "field");
    info_.double_precision = layout_.double_precision;
    info_.count = scan.records;
    for (const E57Column& column : layout_.columns) fields_.push_back(column.field);
    for (const E57Flag& flag : layout_.flags) fields_.push_back(flag.field);
    if (layout_.invalid) count_valid();
  }

  [[nodiscard]] std::uint64_t section_bytes() const { return streams_.section_bytes(); }
  [[nodiscard]] std::uint64_t invalid() const { return streams_.scan().records - info_.count; }
  [[nodiscard]] bool by_angles() const { return layout_.by_angles; }

  /// The grid its points stand in; null where there is none.
  [[nodiscard]] std::shared_ptr<const ScanGrid> grid() const {
    const auto fields = e57_grid_fields(streams_.scan());
    if (!fields) return nullptr;
    E57GridOrder order;
    for_grid_places(*fields, [&](std::int64_t row, std::int64_t column) { order.add(row, column); });
    std::shared_ptr<ScanGrid> grid = order.grid();
    if (grid) for_grid_places(*fields, [&](std::int64_t row, std::int64_t column) { order.mark(row, column, *grid); });
    return grid;
  }

  void place_scanner(ScanPart::Scanner scanner) { info_.scans = {{0, scanner, {}}}; }
  void name_coordinates(const std::string& system) { info_.crs = system; }
  void remark(std::string text) { info_.remarks.push_back(std::move(text)); }

  void read(std::uint64_t first, std::size_t count, SampleBatch& out) override {
    const RowRange rows = rows_there(info_, first, count);
    const std::vector<ColumnTarget> targets = prepare_batch(info_, columns_, rows, out);
    layout_.invalid ? read_valid(rows, targets) : read_all(rows, targets);
    if (layout_.by_angles) place_by_angles(out);
    round_exact_attributes(out);
  }

 private:
  void read_all(RowRange rows, const std::vector<ColumnTarget>& targets) const {
    e57::StreamPieces pieces;
    std::vector<float> flags(kE57Block);
    for (std::size_t done = 0; done < rows.count; done += kE57Block) {
      const std::size_t n = std::min(kE57Block, rows.count - done);
      streams_.read(rows.first + done, n, fields_, pieces);
      for (std::size_t c = 0; c < targets.size(); ++c) {
        if (targets[c].wide != nullptr) fill(pieces, c, n, targets[c].wide + done, flags);
        if (targets[c].narrow != nullptr) fill(pieces, c, n, targets[c].narrow + done, flags);
      }
    }
  }

  /// Block by block of the records: those of a row are found by how many valid ones lie before each block.
  void read_valid(RowRange rows, const std::vector<ColumnTarget>& targets) const {
    if (rows.count == 0) return;
    auto block = static_cast<std::size_t>(std::upper_bound(valid_before_.begin(), valid_before_.end(), rows.first) -
                                          valid_before_.begin()) -
                 1;
    e57::StreamPieces pieces;
    std::vector<float> flags(kE57Block);
    std::vector<double> wide(kE57Block);
    std::vector<float> narrow(kE57Block);
    std::vector<std::size_t> taken;
    std::size_t skip = static_cast<std::size_t>(rows.first - valid_before_[block]);
    for (std::size_t done = 0; done < rows.count; ++block) {
      const std::uint64_t begin = std::uint64_t{block} * kE57Block;
      const auto n = static_cast<std::size_t>(std::min<std::uint64_t>(kE57Block, streams_.scan().records - begin));
      streams_.read(begin, n, fields_, pieces);
      pieces.unpack(layout_.columns.size() + *layout_.invalid, 0, n, flags.data());
      taken.clear();
      for (std::size_t i = 0; i < n && taken.size() < rows.count - done; ++i) {
        if (flags[i] != 0) continue;
        if (skip > 0) {
          --skip;
        } else {
          taken.push_back(i);
        }
      }
      for (std::size_t c = 0; c < targets.size(); ++c) {
        if (targets[c].wide != nullptr) {
          fill(pieces, c, n, wide.data(), flags);
          for (std::size_t i = 0; i < taken.size(); ++i) targets[c].wide[done + i] = wide[taken[i]];
        } else if (targets[c].narrow != nullptr) {
          fill(pieces, c, n, narrow.data(), flags);
          for (std::size_t i = 0; i < taken.size(); ++i) targets[c].narrow[done + i] = narrow[taken[i]];
        }
      }
      done += taken.size();
    }
  }

  /// A column's values of a block, scaled, and 0 where they are marked as invalid.
  template <class Out>
  void fill(const e57::StreamPieces& pieces, std::size_t c, std::size_t n, Out* out, std::vector<float>& flags) const {
    const E57Column& column = layout_.columns[c];
    pieces.unpack(c, 0, n, out);
    if (column.scale != 1 || column.shift != 0) {
      for (std::size_t i = 0; i < n; ++i) {
        const double value = out[i] * column.scale + column.shift;
        out[i] = static_cast<Out>(column.whole ? std::round(value) : value);
      }
    }
    if (!column.flag) return;
    pieces.unpack(layout_.columns.size() + *column.flag, 0, n, flags.data());
    for (std::size_t i = 0; i < n; ++i) {
      if (flags[i] != 0) out[i] = 0;
    }
  }

  /// Calls use(row, column) for every valid point.
  template <class Use>
  void for_grid_places(const std::array<std::size_t, 2>& grid_fields, const Use& use) const {
    e57::StreamPieces pieces;
    std::vector<std::size_t> fields(grid_fields.begin(), grid_fields.end());
    if (layout_.invalid) fields.push_back(layout_.flags[*layout_.invalid].field);
    std::array<std::vector<double>, 2> index{std::vector<double>(kE57Block), std::vector<double>(kE57Block)};
    std::vector<float> flags(kE57Block);
    for (std::uint64_t first = 0; first < streams_.scan().records; first += kE57Block) {
      const auto n = static_cast<std::size_t>(std::min<std::uint64_t>(kE57Block, streams_.scan().records - first));
      streams_.read(first, n, fields, pieces);
      for (std::size_t k = 0; k < 2; ++k) pieces.unpack(k, 0, n, index[k].data());
      if (layout_.invalid) pieces.unpack(2, 0, n, flags.data());
      for (std::size_t i = 0; i < n; ++i) {
        if (flags[i] == 0) use(whole_index(index[0][i]), whole_index(index[1][i]));
      }
    }
  }

  /// As far as grids go; what is no number is at their end.
  static std::int64_t whole_index(double value) {
    constexpr double kFar = E57GridOrder::kLargest;
    return value < kFar ? static_cast<std::int64_t>(std::max(value, -kFar)) : E57GridOrder::kLargest;
  }

  void count_valid() {
    e57::StreamPieces pieces;
    std::vector<float> flags(kE57Block);
    const std::vector<std::size_t> field{layout_.flags[*layout_.invalid].field};
    std::uint64_t valid = 0;
    for (std::uint64_t first = 0; first < streams_.scan().records; first += kE57Block) {
      valid_before_.push_back(valid);
      const auto n = static_cast<std::size_t>(std::min<std::uint64_t>(kE57Block, streams_.scan().records - first));
      streams_.read(first, n, field, pieces);
      pieces.unpack(0, 0, n, flags.data());
      valid += static_cast<std::uint64_t>(std::count(flags.begin(), flags.begin() + static_cast<std::ptrdiff_t>(n), 0));
    }
    info_.count = valid;
  }

  /// Range, azimuth and elevation, which were read as x, y and z.
  static void place_by_angles(SampleBatch& out) {
    for (std::size_t i = 0; i < out.size(); ++i) {
      const double range = out.x[i];
      const double azimuth = out.y[i];
      const double elevation = out.z[i];
      out.x[i] = range * std::cos(elevation) * std::cos(azimuth);
      out.y[i] = range * std::cos(elevation) * std::sin(azimuth);
      out.z[i] = range * std::sin(elevation);
    }
  }

  e57::RecordStreams streams_;
  E57Columns layout_;
  std::vector<PointColumn> columns_;
  std::vector<std::size_t> fields_;          ///< of the columns, then of the flags
  std::vector<std::uint64_t> valid_before_;  ///< rows before each block of records, where some may be invalid
};

class NoE57Points final : public PointSource {
 public:
  explicit NoE57Points(const std::string& path) {
    info_.path = path;
    info_.random_access = true;
  }
  void read(std::uint64_t, std::size_t, SampleBatch& out) override { prepare_batch(info_, {}, {0, 0}, out); }
};

Pose pose_of(const e57::Scan& scan) {
  const auto& [w, x, y, z] = scan.rotation;
  const auto& t = scan.translation;
  return {{{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), t[0]},
           {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x), t[1]},
           {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y), t[2]},
           {0, 0, 0, 1}}};
}

/// Whether a scanner stood at the scan's origin. A pose that turns nothing, of a single cloud without angles, may as
/// well be where a program put large coordinates.
ScanPart::Scanner scanner_of(const e57::Scan& scan, const e57::Contents& contents, bool by_angles) {
  const bool turned = scan.rotation != std::array<double, 4>{1, 0, 0, 0};
  const bool several = std::any_of(contents.scans.begin(), contents.scans.end(), [&](const e57::Scan& other) {
    return other.has_pose && scan.has_pose && other.translation != scan.translation;
  });
  if (by_angles || turned || several || e57_grid_fields(scan)) return ScanPart::Scanner::position;
  return scan.has_pose ? ScanPart::Scanner::pose_origin : ScanPart::Scanner::unknown;
}

}  // namespace

std::unique_ptr<PointSource> open_e57(InputFile file, const std::string& path, bool ignore_checksums) {
  const auto shared = std::make_shared<const InputFile>(std::move(file));
  const auto pages = std::make_shared<const e57::PagedFile>(
      e57::FileBytes{
          [shared](std::uint64_t offset, void* data, std::size_t size) { return shared->read(offset, data, size); },
          shared->bytes, shared->name},
      ignore_checksums);
  const e57::Contents contents = e57::read_contents(*pages);
  std::vector<std::unique_ptr<E57Scan>> scans;
  std::uint64_t bytes = 0;
  std::uint64_t invalid = 0;
  for (const e57::Scan& scan : contents.scans) {
    scans.push_back(std::make_unique<E57Scan>(path, pages, scan));
    scans.back()->name_coordinates(contents.coordinate_metadata);
    bytes += scans.back()->section_bytes();
    if (bytes > pages->size()) pages->refuse("its sections of points overlap: the file is damaged");
    invalid += scans.back()->invalid();
  }
  if (scans.empty()) return std::make_unique<NoE57Points>(path);
  if (invalid > 0) {
    scans.front()->remark(fmt::format("{}: {} points are marked as invalid and left out", shared->name, invalid));
  }
  if (contents.images > 0) {
    scans.front()->remark(fmt::format("{}: {} images are left out", shared->name, contents.images));
  }
  std::vector<std::unique_ptr<PointSource>> sources;
  for (std::size_t i = 0; i < scans.size(); ++i) {
    const e57::Scan& scan = contents.scans[i];
    const ScanPart::Scanner scanner = scanner_of(scan, contents, scans[i]->by_angles());
    if (scanner != ScanPart::Scanner::unknown) scans[i]->place_scanner(scanner);
    std::shared_ptr<const ScanGrid> grid = scans[i]->grid();
    std::unique_ptr<PointSource> source = std::move(scans[i]);
    if (grid) source = organised_points(std::move(source), std::move(grid));
    const Pose pose = pose_of(scan);
    sources.push_back(pose == PointInput{}.pose ? std::move(source) : pose_points(std::move(source), pose));
  }
  return join_points(std::move(sources));
}

}  // namespace lamina
