#include "store/ingest.h"

#include <fmt/format.h>
#include <tbb/parallel_pipeline.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <limits>
#include <memory>
#include <mutex>
#include <tuple>
#include <utility>
#include <vector>

#include "lamina/error.h"

namespace lamina {
namespace {

/// Places across the cloud's diagonal.
constexpr double kPlacesAcross = 100;
/// Of many samples in a place a few tell who saw it.
constexpr std::size_t kStride = 8;

}  // namespace

ScanOverlap::ScanOverlap(std::vector<ScanPart> scans, const Eigen::Vector3d& low, const Eigen::Vector3d& high)
    : scans_(std::move(scans)), low_(low) {
  const double diagonal = (high - low).norm();
  inverse_ = diagonal > 0 ? kPlacesAcross / diagonal : 0;
}

void ScanOverlap::add(const SampleBatch& batch) {
  if (scans_.size() < 2) return;
  for (std::size_t i = 0; i < batch.size(); i += kStride) {
    const Eigen::Vector3d at = (Eigen::Vector3d(batch.x[i], batch.y[i], batch.z[i]) - low_) * inverse_;
    // Samples far outside of the box, and those that are not finite, are no place.
    if (!(at.cwiseAbs().maxCoeff() < 2 * kPlacesAcross)) continue;
    const auto next = std::upper_bound(scans_.begin(), scans_.end(), batch.first + i,
                                       [](std::uint64_t row, const ScanPart& scan) { return row < scan.first; });
    const auto scan = static_cast<std::uint32_t>(next - scans_.begin());
    const Place place{{static_cast<std::int32_t>(std::floor(at.x())), static_cast<std::int32_t>(std::floor(at.y())),
                       static_cast<std::int32_t>(std::floor(at.z()))}};
    const auto [known, is_new] = seen_by_.try_emplace(place, scan);
    if (!is_new && known->second != scan) known->second = kSeveral;
  }
}

double ScanOverlap::share() const {
  if (seen_by_.empty()) return 0;
  const auto several =
      std::count_if(seen_by_.begin(), seen_by_.end(), [](const auto& place) { return place.second == kSeveral; });
  return static_cast<double>(several) / static_cast<double>(seen_by_.size());
}

namespace {

constexpr std::size_t kChunk = 1u << 15;  ///< rows a piece
/// Samples a bucket should hold: few, so that little is read before it is needed and threads share the work evenly. Of
/// small clouds more, for it makes no difference there.
constexpr std::uint64_t kBucketSamples = 1u << 14, kSmallCloudsBucket = 1u << 15;
constexpr std::uint64_t kSmallCloud = 1u << 21;
/// Where samples come in random order, each bucket has blocks as long as its part of the buffer allows. So there are at
/// most so many buckets, and of large clouds, beside which a larger buffer is small, up to four times as many.
constexpr std::uint64_t kMaxBuckets = 4096;
constexpr std::uint64_t kLargeCloud = 1u << 26, kMostTimes = 4;

/// Fixed-point coordinates may reach a little beyond the box surveyed, and qualities beyond the greatest seen.
constexpr double kMostSteps = (1 << 29) + (1 << 25);
constexpr double kMostQuality = 1 << 20;

constexpr std::int32_t kMax = std::numeric_limits<std::int32_t>::max();
constexpr std::int32_t kMin = std::numeric_limits<std::int32_t>::min();
constexpr Extent kNothing{{kMax, kMin, kMax, kMin}, kMax, kMin};

struct IngestPiece {
  SampleBatch rows;
  LocalSamples local;
  Extent extent = kNothing;
  Census census;
  bool within = true;  ///< every sample lies where it may
};

/// Pieces in use by the pipeline; their memory goes from one to the next.
class PiecePool {
 public:
  IngestPiece* take() {
    const std::lock_guard lock(mutex_);
    if (idle_.empty()) {
      pieces_.push_back(std::make_unique<IngestPiece>());
      return pieces_.back().get();
    }
    IngestPiece* const piece = idle_.back();
    idle_.pop_back();
    return piece;
  }
  void give_back(IngestPiece* piece) {
    const std::lock_guard lock(mutex_);
    idle_.push_back(piece);
  }

 private:
  std::mutex mutex_;
  std::vector<std::unique_ptr<IngestPiece>> pieces_;
  std::vector<IngestPiece*> idle_;
};

/// Factor that brings the greatest quality to at most 1, so that sums of weights cannot overflow. A power of two: the
/// surface does not depend on it. 0 where every quality is 0, which tells no weights: MeshLab writes such.
double quality_scale(const Survey& survey) {
  if (!(survey.max_quality > 0)) return 0;
  return std::exp2(-std::ceil(std::log2(double{survey.max_quality})));
}

/// A radius in steps: a smaller one than a step reaches nothing but itself, a greater one than the cloud everything.
float radius_in_steps(double radius) {
  constexpr double kDiagonal = 1 << 30;
  return static_cast<float>(std::clamp(radius, 1.0, kDiagonal));
}

void resize(LocalSamples& out, const SampleBatch& rows, std::size_t n) {
  for (auto* values : {&out.x, &out.y, &out.z}) values->resize(n);
  for (auto* values : {&out.nx, &out.ny, &out.nz}) values->resize(n);
  out.radius.resize(rows.radius.empty() ? 0 : n);
  out.quality.resize(rows.quality.empty() ? 0 : n);
  out.attributes.resize(rows.attributes.size());
  for (auto& values : out.attributes) values.resize(n);
}

std::pair<std::int32_t, std::int32_t> range_of(const std::vector<std::int32_t>& values) {
  std::int32_t low = kMax;
  std::int32_t high = kMin;
  for (const std::int32_t v : values) {
    low = std::min(low, v);
    high = std::max(high, v);
  }
  return {low, high};
}

/// Fills the rest of a piece from `piece.rows`.
void to_local(IngestPiece& piece, const AttributeLayout& layout, const Frame& frame, const IngestSettings& settings,
              double quality_scale) {
  const SampleBatch& rows = piece.rows;
  LocalSamples& out = piece.local;
  Census& census = piece.census;
  census = {};
  census.count_attributes(rows, layout);
  resize(out, rows, rows.size());
  const Eigen::Matrix3d turn = frame.rotation;
  const Eigen::Matrix3d scale = frame.rotation / frame.step;
  const double radius = settings.radius_scale / frame.step;
  double farthest = 0;
  std::size_t n = 0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (!census.takes(settings.pick, rows, i)) continue;
    const Defect defect = defect_of(rows, i);
    if (defect != Defect::none) {
      census.reject(defect, rows.first + i);
      continue;
    }
    const Eigen::Vector3d at(rows.x[i], rows.y[i], rows.z[i]);
    census.low = census.low.cwiseMin(at);
    census.high = census.high.cwiseMax(at);
    const Eigen::Vector3d p = scale * (at - frame.origin);
    const Eigen::Vector3d normal = (turn * Eigen::Vector3d(rows.nx[i], rows.ny[i], rows.nz[i])).normalized();
    farthest = std::max(farthest, p.cwiseAbs().maxCoeff());
    const Eigen::Vector3d q = p.cwiseMax(-kMostSteps).cwiseMin(kMostSteps);
    out.x[n] = static_cast<std::int32_t>(std::lrint(q.x()));
    out.y[n] = static_cast<std::int32_t>(std::lrint(q.y()));
    out.z[n] = static_cast<std::int32_t>(std::lrint(q.z()));
    out.nx[n] = static_cast<float>(normal.x());
    out.ny[n] = static_cast<float>(normal.y());
    out.nz[n] = static_cast<float>(normal.z());
    if (!rows.radius.empty()) out.radius[n] = radius_in_steps(rows.radius[i] * radius);
    if (!rows.quality.empty()) {
      census.max_quality = std::max(census.max_quality, rows.quality[i]);
      out.quality[n] = quality_scale > 0 ? static_cast<float>(rows.quality[i] * quality_scale) : 1.0F;
    }
    for (std::size_t c = 0; c < rows.attributes.size(); ++c) {
      out.attributes[c][n] = usable_attribute(rows.attributes[c][i]);
    }
    ++n;
  }
  census.usable = n;
  const bool weighs = quality_scale > 0 ? census.max_quality * quality_scale <= kMostQuality : census.max_quality == 0;
  piece.within = farthest <= kMostSteps && weighs;
  resize(out, rows, n);
  std::tie(piece.extent.x_min, piece.extent.x_max) = range_of(out.x);
  std::tie(piece.extent.y_min, piece.extent.y_max) = range_of(out.y);
  std::tie(piece.extent.z_min, piece.extent.z_max) = range_of(out.z);
}

}  // namespace

void widen(Extent& b, const Extent& by) {
  b.x_min = std::min(b.x_min, by.x_min);
  b.x_max = std::max(b.x_max, by.x_max);
  b.y_min = std::min(b.y_min, by.y_min);
  b.y_max = std::max(b.y_max, by.y_max);
  b.z_min = std::min(b.z_min, by.z_min);
  b.z_max = std::max(b.z_max, by.z_max);
}

StoreSettings store_settings(const Survey& survey, const Frame& frame, const StorePlace& place) {
  // The rotated bounding box bounds the samples' z.
  const Eigen::Vector3d half = 0.5 * (survey.high - survey.low) / frame.step;
  constexpr double kMargin = 1.0625;  // where only a part of the samples has been seen, others lie a little outside
  const double reach = kMargin * frame.rotation.row(2).cwiseAbs().dot(half.transpose()) + 1;
  StoreSettings s;
  s.directory = place.directory;
  s.keep = place.keep;
  s.z_min = static_cast<std::int32_t>(-std::ceil(reach));
  const std::uint64_t held = survey.usable < kSmallCloud ? kSmallCloudsBucket : kBucketSamples;
  const std::uint64_t times = std::bit_floor(std::clamp<std::uint64_t>(survey.usable / kLargeCloud, 1, kMostTimes));
  s.buffer_bytes *= times;
  const std::uint64_t wanted = std::clamp<std::uint64_t>(survey.usable / held, 1, kMaxBuckets * times);
  s.bucket_height = static_cast<std::int32_t>(std::ceil(2 * reach / static_cast<double>(wanted))) + 1;
  s.buckets = static_cast<std::size_t>(std::ceil(2 * reach / s.bucket_height)) + 1;
  return s;
}

Ingested ingest(PointSource& source, const Survey& survey, const Frame& frame, const StorePlace& place,
                const RunContext& run, const IngestSettings& settings) {
  const PointSourceInfo& info = source.info();
  const StoreSettings buckets = store_settings(survey, frame, place);
  SlabStoreWriter writer({info.has_radius, info.has_quality, info.attributes}, buckets);
  Extent extent = kNothing;
  Census census;
  bool complete = true;
  const double quality = quality_scale(survey);
  const std::int64_t top = buckets.z_min + static_cast<std::int64_t>(buckets.buckets) * buckets.bucket_height;
  ScanOverlap overlap(info.scans, survey.low, survey.high);
  PiecePool pool;
  const std::uint64_t end = std::min(settings.rows.end, info.count);
  std::uint64_t next = std::min(settings.rows.first, end);
  const std::uint64_t count = end - next;
  std::uint64_t done = 0;
  std::atomic<bool> stopped = false;
  const auto read = [&](SampleBatch& out) {
    source.read(out.first, std::min<std::uint64_t>(kChunk, end - out.first), out);
  };
  const auto take = [&](tbb::flow_control& flow) -> IngestPiece* {
    if (next >= end || stopped || run.cancelled()) {
      flow.stop();
      return nullptr;
    }
    IngestPiece* const piece = pool.take();
    piece->rows.first = next;
    if (!info.random_access) read(piece->rows);
    next += kChunk;
    return piece;
  };
  const auto convert = [&](IngestPiece* piece) {
    if (info.random_access) read(piece->rows);
    to_local(*piece, info.attributes, frame, settings, quality);
    return piece;
  };
  const auto append = [&](IngestPiece* piece) {
    widen(extent, piece->extent);
    census.merge(piece->census);
    // Buckets at the ends that swallow whatever lies beyond them would be tall, and full.
    complete =
        complete && piece->within && (census.usable == 0 || (extent.z_min >= buckets.z_min && extent.z_max < top));
    stopped = !complete;
    if (complete) writer.append(piece->local);
    overlap.add(piece->rows);
    done += piece->rows.size();
    if (run.progress) run.progress({"read", done, count, 0, 0});
    pool.give_back(piece);
  };
  constexpr std::size_t kInFlight = 8;
  tbb::parallel_pipeline(kInFlight,
                         tbb::make_filter<void, IngestPiece*>(tbb::filter_mode::serial_in_order, take) &
                             tbb::make_filter<IngestPiece*, IngestPiece*>(tbb::filter_mode::parallel, convert) &
                             tbb::make_filter<IngestPiece*, void>(tbb::filter_mode::serial_in_order, append));
  if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
  return {writer.finish(), extent, census, complete, overlap.share()};
}

namespace {

/// Of a row's id, for so many rows: one bit is that of given normals.
std::size_t digits_for(std::uint64_t rows) {
  std::size_t digits = 1;
  while (rows >> (16 * digits - 1) != 0) ++digits;
  return digits;
}
/// The highest bit of an id.
std::uint64_t given_bit(std::size_t digits) {
  return std::uint64_t{1} << (16 * digits - 1);
}

bool is_usable(float x, float y, float z) {
  const double squared = double{x} * double{x} + double{y} * double{y} + double{z} * double{z};
  return std::isfinite(squared) && squared >= kLeastNormalSquared;
}

std::uint64_t id_of(const LocalSamples& samples, std::size_t i) {
  std::uint64_t id = 0;
  for (std::size_t d = 0; d < samples.attributes.size(); ++d)
    id |= static_cast<std::uint64_t>(samples.attributes[d][i]) << (16 * d);
  return id;
}

}  // namespace

RowIdSource::RowIdSource(PointSource& source, bool with_normals)
    : source_(source), with_normals_(with_normals && source.info().has_normals) {
  info_.path = source.info().path;
  info_.count = source.info().count;
  info_.random_access = source.info().random_access;
  info_.has_normals = true;
  const std::size_t digits = digits_for(info_.count);
  for (std::size_t d = 0; d < digits; ++d) info_.attributes.push_back({fmt::format("row{}", d), ScalarType::uint16});
}

void RowIdSource::read(std::uint64_t first, std::size_t count, SampleBatch& out) {
  source_.read(first, count, out);
  const std::size_t n = out.size();
  if (!with_normals_) {
    out.nx.assign(n, 0);
    out.ny.assign(n, 0);
    out.nz.assign(n, 0);
  }
  out.radius.clear();
  out.quality.clear();
  out.exact.clear();
  const std::size_t digits = info_.attributes.size();
  const std::uint64_t given = given_bit(digits);
  out.attributes.resize(digits);
  for (auto& digit : out.attributes) digit.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    std::uint64_t id = first + i;
    if (is_usable(out.nx[i], out.ny[i], out.nz[i])) {
      id |= given;
    } else {
      out.nx[i] = 0;
      out.ny[i] = 0;
      out.nz[i] = 1;
    }
    for (std::size_t d = 0; d < digits; ++d) out.attributes[d][i] = static_cast<float>((id >> (16 * d)) & 0xFFFFU);
  }
}

std::uint64_t row_of(const LocalSamples& samples, std::size_t i) {
  return id_of(samples, i) & ~given_bit(samples.attributes.size());
}

bool has_given_normal(const LocalSamples& samples, std::size_t i) {
  return (id_of(samples, i) & given_bit(samples.attributes.size())) != 0;
}

}  // namespace lamina
