#include "lamina/edit.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/descriptor.h"
#include "base/run.h"
#include "edit/rows.h"
#include "lamina/error.h"
#include "points/point_columns.h"

namespace lamina {
namespace {

constexpr std::size_t kBatch = std::size_t{1} << 15;

/// The order of doubles as the order of integers; -0 and 0 are the same.
std::uint64_t ordered(double value) {
  const auto bits = std::bit_cast<std::uint64_t>(value + 0.0);
  return (bits >> 63) != 0 ? ~bits : bits | (std::uint64_t{1} << 63);
}

/// Spreads 21 bits so that two zeros follow each.
std::uint64_t spread(std::uint64_t v) {
  v = (v | v << 32) & 0x1F00000000FFFFULL;
  v = (v | v << 16) & 0x1F0000FF0000FFULL;
  v = (v | v << 8) & 0x100F00F00F00F00FULL;
  v = (v | v << 4) & 0x10C30C30C30C30C3ULL;
  return (v | v << 2) & 0x1249249249249249ULL;
}

/// Where a cloud lies: of the rows with finite positions; without any, count is 0 and the box is empty.
struct Extent {
  std::uint64_t count = 0;
  Eigen::Vector3d low, high;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
};

/// Sums are made of batches in order, about the first point: the same bits for any number of threads, and no
/// cancellation far from the origin.
Extent find_extent(PointSource& source, const RunContext& run) {
  Extent e;
  e.low.setConstant(std::numeric_limits<double>::infinity());
  e.high = -e.low;
  Eigen::Vector3d pivot = Eigen::Vector3d::Zero(), sum = Eigen::Vector3d::Zero();
  Eigen::Matrix3d products = Eigen::Matrix3d::Zero();
  edit::for_each_batch(
      source, "survey", run, [](SampleBatch&) {},
      [&](const SampleBatch& b) {
        for (std::size_t i = 0; i < b.size(); ++i) {
          const Eigen::Vector3d p(b.x[i], b.y[i], b.z[i]);
          if (!p.allFinite()) continue;
          if (e.count++ == 0) pivot = p;
          e.low = e.low.cwiseMin(p);
          e.high = e.high.cwiseMax(p);
          const Eigen::Vector3d d = p - pivot;
          sum += d;
          products += d * d.transpose();
        }
      });
  if (e.count == 0) return e;
  const auto n = static_cast<double>(e.count);
  e.covariance = products / n - (sum / n) * (sum / n).transpose();
  return e;
}

/// Unit vector of the greatest spread, its largest component positive.
Eigen::Vector3d dominant_axis(const Extent& extent) {
  if (!extent.covariance.allFinite()) return Eigen::Vector3d::UnitZ();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(extent.covariance);
  Eigen::Vector3d axis = solver.eigenvectors().col(2);
  int largest = 0;
  axis.cwiseAbs().maxCoeff(&largest);
  return axis[largest] < 0 ? Eigen::Vector3d(-axis) : axis;
}

/// Keys of a batch's rows.
class Keys {
 public:
  Keys(const SortSettings& settings, PointSource& source, const RunContext& run) : settings_(settings) {
    if (settings.key == SortKey::attribute) {
      find_attribute(source.info());
    } else if (settings.key == SortKey::sweep || settings.key == SortKey::spatial) {
      const Extent extent = find_extent(source, run);
      low_ = extent.low;
      const double side = (extent.high - extent.low).maxCoeff();
      per_cell_ = side > 0 ? ((1 << 21) - 1) / side : 0;
      if (settings.key == SortKey::sweep) direction_ = dominant_axis(extent);
    }
  }

  [[nodiscard]] std::vector<std::uint64_t> of(const SampleBatch& b) const {
    std::vector<std::uint64_t> keys(b.size());
    for (std::size_t i = 0; i < keys.size(); ++i) {
      const std::uint64_t key = at(b, i);
      keys[i] = settings_.reverse ? ~key : key;
    }
    return keys;
  }

 private:
  void find_attribute(const PointSourceInfo& info) {
    std::string known = "positions only (--by x, y or z)";
    by_radius_ = info.has_radius && settings_.attribute == info.radius_name;
    if (by_radius_ || (info.has_quality && settings_.attribute == info.quality_name)) return;
    std::vector<std::string> names;
    if (info.has_radius) names.push_back(info.radius_name);
    if (info.has_quality) names.push_back(info.quality_name);
    for (std::size_t a = 0; a < info.attributes.size(); ++a) {
      if (info.attributes[a].name == settings_.attribute) {
        attribute_ = a;
        return;
      }
      names.push_back(info.attributes[a].name);
    }
    if (!names.empty()) known = fmt::format("{}", fmt::join(names, ", "));
    throw Error(ExitCode::usage,
                fmt::format("{}: has no attribute '{}' to sort by; it has {}", info.path, settings_.attribute, known));
  }

  [[nodiscard]] std::uint64_t at(const SampleBatch& b, std::size_t i) const {
    const Eigen::Vector3d p(b.x[i], b.y[i], b.z[i]);
    switch (settings_.key) {
      case SortKey::x:
        return ordered(p.x());
      case SortKey::y:
        return ordered(p.y());
      case SortKey::z:
        return ordered(p.z());
      case SortKey::sweep:
        return ordered(direction_.dot(p - low_));
      case SortKey::spatial: {
        const Eigen::Vector3d cell = (p - low_) * per_cell_;
        return spread(static_cast<std::uint64_t>(cell.x())) | spread(static_cast<std::uint64_t>(cell.y())) << 1 |
               spread(static_cast<std::uint64_t>(cell.z())) << 2;
      }
      case SortKey::attribute:
        break;
    }
    if (!attribute_) return ordered(by_radius_ ? double{b.radius[i]} : double{b.quality[i]});
    const bool exact = *attribute_ < b.exact.size() && !b.exact[*attribute_].empty();
    return ordered(exact ? b.exact[*attribute_][i] : double{b.attributes[*attribute_][i]});
  }

  SortSettings settings_;
  Eigen::Vector3d low_ = Eigen::Vector3d::Zero(), direction_ = Eigen::Vector3d::UnitZ();
  double per_cell_ = 0;
  std::optional<std::size_t> attribute_;
  bool by_radius_ = false;
};

/// Takes the rows instead of a file, with their keys.
class ToSorter final : public PointsWriter {
 public:
  ToSorter(const PointColumns& columns, const Keys& keys, const std::string& name, edit::RecordSorter& sorter,
           const RowCodec& codec)
      : PointsWriter(columns), keys_(keys), name_(name), sorter_(sorter), codec_(codec) {}
  void append(const SampleBatch& batch) override {
    codec_.require_writable(batch, rows_, name_);
    bytes_.resize(batch.size() * codec_.row_bytes());
    codec_.encode(batch, 0, batch.size(), bytes_.data());
    sorter_.add(keys_.of(batch), bytes_.data());
    rows_ += batch.size();
  }
  void commit() override {}

 private:
  const Keys& keys_;
  std::string name_;
  edit::RecordSorter& sorter_;
  const RowCodec& codec_;
  std::vector<std::byte> bytes_;
};

}  // namespace

EditReport sort_points(PointSource& source, PointsWriter& writer, const SortSettings& settings, const RunContext& run) {
  const Keys keys(settings, source, run);
  const PointColumns& columns = writer.columns();
  const RowCodec codec(columns);
  const std::size_t memory = run.max_memory > 0 ? std::min(settings.memory, run.max_memory / 4) : settings.memory;
  const std::uint64_t whole = source.info().count * (codec.row_bytes() + 12);
  constexpr std::uint64_t kProgram = std::uint64_t{56} << 20;  // measured: batches on their way, and the program
  require_memory(run, kProgram + std::min<std::uint64_t>(memory, whole), source.info().path, "sorting");
  edit::RecordSorter sorter(codec.row_bytes(), static_cast<std::size_t>(std::min<std::uint64_t>(memory, whole)),
                            run.tmp_dir.empty() ? system_tmp_dir() : run.tmp_dir);
  ToSorter filler(columns, keys, source.info().path, sorter, codec);
  EditReport report = edit_points(source, filler, {}, settings.bad_samples, run);
  SampleBatch batch;
  sorter.drain(kBatch, [&](std::span<const std::uint64_t> some, const std::byte* rows) {
    if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
    codec.decode(rows, codec.row_bytes(), some.size(), batch);
    writer.append(batch);
    if (run.progress) run.progress({"sort", writer.rows(), sorter.size(), 0, 0});
  });
  report.written = writer.rows();
  return report;
}

}  // namespace lamina
