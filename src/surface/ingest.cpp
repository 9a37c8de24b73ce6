#include "surface/ingest.h"

#include <tbb/parallel_pipeline.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include "lamina/error.h"

namespace lamina {
namespace {

constexpr std::size_t kChunk = 1u << 15;            ///< rows a piece
constexpr std::uint64_t kBucketSamples = 1u << 15;  ///< samples a bucket should hold
constexpr std::uint64_t kMaxBuckets = 4096;

struct Piece {
  SampleBatch rows;
  LocalSamples local;
};

/// Factor that brings the greatest quality to at most 1, so that sums of weights cannot overflow. A power of two: the
/// surface does not depend on it.
double quality_scale(const Survey& survey) {
  if (!(survey.max_quality > 0)) return 1;
  return std::exp2(-std::ceil(std::log2(double{survey.max_quality})));
}

/// A radius in steps: a smaller one than a step reaches nothing but itself, a greater one than the cloud everything.
float radius_in_steps(double radius) {
  constexpr double kDiagonal = 1 << 30;
  return static_cast<float>(std::clamp(radius, 1.0, kDiagonal));
}

void to_local(const SampleBatch& rows, const Frame& frame, double radius_scale, double quality_scale,
              LocalSamples& out) {
  out.clear();
  out.reserve(rows.size());
  out.attributes.resize(rows.attributes.size());
  const Eigen::Matrix3d turn = frame.rotation;
  const Eigen::Matrix3d scale = frame.rotation / frame.step;
  const double radius = radius_scale / frame.step;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (defect_of(rows, i) != Defect::none) continue;
    const Eigen::Vector3d p = scale * (Eigen::Vector3d(rows.x[i], rows.y[i], rows.z[i]) - frame.origin);
    const Eigen::Vector3d n = (turn * Eigen::Vector3d(rows.nx[i], rows.ny[i], rows.nz[i])).normalized();
    out.x.push_back(static_cast<std::int32_t>(std::lrint(p.x())));
    out.y.push_back(static_cast<std::int32_t>(std::lrint(p.y())));
    out.z.push_back(static_cast<std::int32_t>(std::lrint(p.z())));
    out.nx.push_back(static_cast<float>(n.x()));
    out.ny.push_back(static_cast<float>(n.y()));
    out.nz.push_back(static_cast<float>(n.z()));
    if (!rows.radius.empty()) out.radius.push_back(radius_in_steps(rows.radius[i] * radius));
    if (!rows.quality.empty()) out.quality.push_back(static_cast<float>(rows.quality[i] * quality_scale));
    for (std::size_t c = 0; c < rows.attributes.size(); ++c) {
      out.attributes[c].push_back(usable_attribute(rows.attributes[c][i]));
    }
  }
}

void widen(Extent& b, const LocalSamples& s) {
  if (s.size() == 0) return;
  const auto [x0, x1] = std::minmax_element(s.x.begin(), s.x.end());
  const auto [y0, y1] = std::minmax_element(s.y.begin(), s.y.end());
  b.x_min = std::min(b.x_min, *x0);
  b.x_max = std::max(b.x_max, *x1);
  b.y_min = std::min(b.y_min, *y0);
  b.y_max = std::max(b.y_max, *y1);
  const auto [z0, z1] = std::minmax_element(s.z.begin(), s.z.end());
  b.z_min = std::min(b.z_min, *z0);
  b.z_max = std::max(b.z_max, *z1);
}

StoreSettings store_settings(const Survey& survey, const Frame& frame, const std::string& directory) {
  // The rotated bounding box bounds the samples' z.
  const Eigen::Vector3d half = 0.5 * (survey.high - survey.low) / frame.step;
  const double reach = frame.rotation.row(2).cwiseAbs().dot(half.transpose()) + 1;
  StoreSettings s;
  s.directory = directory;
  s.z_min = static_cast<std::int32_t>(-std::ceil(reach));
  const std::uint64_t wanted = std::clamp<std::uint64_t>(survey.usable / kBucketSamples, 1, kMaxBuckets);
  s.bucket_height = static_cast<std::int32_t>(std::ceil(2 * reach / static_cast<double>(wanted))) + 1;
  s.buckets = static_cast<std::size_t>(std::ceil(2 * reach / s.bucket_height)) + 1;
  return s;
}

}  // namespace

Ingested ingest(PointSource& source, const Survey& survey, const Frame& frame, double radius_scale,
                const std::string& directory, const RunContext& run) {
  const PointSourceInfo& info = source.info();
  SlabStoreWriter writer({info.has_radius, info.has_quality, info.attributes},
                         store_settings(survey, frame, directory));
  constexpr std::int32_t kMax = std::numeric_limits<std::int32_t>::max();
  constexpr std::int32_t kMin = std::numeric_limits<std::int32_t>::min();
  Extent extent{{kMax, kMin, kMax, kMin}, kMax, kMin};
  const double quality = quality_scale(survey);
  std::uint64_t next = 0;
  const auto take = [&](tbb::flow_control& flow) -> std::shared_ptr<Piece> {
    if (next >= info.count || run.cancelled()) {
      flow.stop();
      return nullptr;
    }
    auto piece = std::make_shared<Piece>();
    piece->rows.first = next;
    if (!info.random_access) source.read(next, kChunk, piece->rows);
    next += kChunk;
    return piece;
  };
  const auto convert = [&](const std::shared_ptr<Piece>& piece) {
    if (info.random_access) source.read(piece->rows.first, kChunk, piece->rows);
    to_local(piece->rows, frame, radius_scale, quality, piece->local);
    return piece;
  };
  const auto append = [&](const std::shared_ptr<Piece>& piece) {
    widen(extent, piece->local);
    writer.append(piece->local);
    if (run.progress) run.progress({"read", std::min(piece->rows.first + kChunk, info.count), info.count, 0, 0});
  };
  constexpr std::size_t kInFlight = 8;
  tbb::parallel_pipeline(
      kInFlight,
      tbb::make_filter<void, std::shared_ptr<Piece>>(tbb::filter_mode::serial_in_order, take) &
          tbb::make_filter<std::shared_ptr<Piece>, std::shared_ptr<Piece>>(tbb::filter_mode::parallel, convert) &
          tbb::make_filter<std::shared_ptr<Piece>, void>(tbb::filter_mode::serial_in_order, append));
  if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
  return {writer.finish(), extent};
}

}  // namespace lamina
