#include "surface/survey.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "lamina/error.h"

namespace lamina {
namespace {

constexpr std::size_t kChunk = 1u << 16;  ///< rows a piece; fixed, so sums do not depend on the number of threads

/// Moments of a piece about its own first sample, where they cannot cancel.
struct Partial {
  std::uint64_t usable = 0;
  std::array<std::uint64_t, kDefects> rejected{};
  std::array<std::uint64_t, kDefects> first_row{};
  Eigen::Vector3d low = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector3d high = -low;
  Eigen::Vector3d pivot = Eigen::Vector3d::Zero();
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  Eigen::Matrix3d products = Eigen::Matrix3d::Zero();
  float max_quality = 0;
  std::uint64_t unusable_attributes = 0;
  std::uint64_t first_unusable_attribute = 0;
};

void look_at_attributes(const SampleBatch& batch, const AttributeLayout& layout, Partial& p) {
  for (std::size_t c = 0; c < batch.attributes.size(); ++c) {
    if (layout[c].type != ScalarType::float32 && layout[c].type != ScalarType::float64) continue;  // always in range
    const std::vector<float>& values = batch.attributes[c];
    const auto bad = [](float v) { return !(std::abs(v) <= kLargestAttribute); };
    const auto count = static_cast<std::uint64_t>(std::count_if(values.begin(), values.end(), bad));
    if (count == 0) continue;
    const auto at = std::find_if(values.begin(), values.end(), bad) - values.begin();
    const std::uint64_t row = batch.first + static_cast<std::uint64_t>(at);
    p.first_unusable_attribute = p.unusable_attributes == 0 ? row : std::min(row, p.first_unusable_attribute);
    p.unusable_attributes += count;
  }
}

Partial look_at(const SampleBatch& batch, const AttributeLayout& layout) {
  Partial p;
  look_at_attributes(batch, layout, p);
  for (std::size_t i = 0; i < batch.size(); ++i) {
    const Defect defect = defect_of(batch, i);
    if (defect != Defect::none) {
      const auto k = static_cast<std::size_t>(defect);
      if (p.rejected[k]++ == 0) p.first_row[k] = batch.first + i;
      continue;
    }
    const Eigen::Vector3d x(batch.x[i], batch.y[i], batch.z[i]);
    if (p.usable++ == 0) p.pivot = x;
    const Eigen::Vector3d d = x - p.pivot;
    p.low = p.low.cwiseMin(x);
    p.high = p.high.cwiseMax(x);
    p.sum += d;
    p.products += d * d.transpose();
    if (!batch.quality.empty()) p.max_quality = std::max(p.max_quality, batch.quality[i]);
  }
  return p;
}

/// Adds piece `b` to `a`, moving its moments to the pivot of `a`.
void merge(Partial& a, const Partial& b) {
  for (std::size_t k = 0; k < kDefects; ++k) {
    if (a.rejected[k] == 0) a.first_row[k] = b.first_row[k];
    a.rejected[k] += b.rejected[k];
  }
  if (a.unusable_attributes == 0) a.first_unusable_attribute = b.first_unusable_attribute;
  a.unusable_attributes += b.unusable_attributes;
  a.max_quality = std::max(a.max_quality, b.max_quality);
  if (b.usable == 0) return;
  if (a.usable == 0) a.pivot = b.pivot;
  const Eigen::Vector3d s = b.pivot - a.pivot;
  const auto n = static_cast<double>(b.usable);
  a.products += b.products + s * b.sum.transpose() + b.sum * s.transpose() + n * s * s.transpose();
  a.sum += b.sum + n * s;
  a.usable += b.usable;
  a.low = a.low.cwiseMin(b.low);
  a.high = a.high.cwiseMax(b.high);
}

Partial look_at_all(PointSource& source, const RunContext& run) {
  const std::uint64_t count = source.info().count;
  Partial total;
  std::uint64_t done = 0;
  const auto report = [&] {
    if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
    if (run.progress) run.progress({"survey", done, count, 0, 0});
  };
  if (!source.info().random_access) {
    SampleBatch batch;
    while (done < count) {
      source.read(done, kChunk, batch);
      merge(total, look_at(batch, source.info().attributes));
      done = std::min<std::uint64_t>(count, done + kChunk);
      report();
    }
    return total;
  }
  constexpr std::size_t kPieces = 16;
  std::array<SampleBatch, kPieces> batches;
  std::array<Partial, kPieces> partials;
  while (done < count) {
    tbb::parallel_for(std::size_t{0}, kPieces, [&](std::size_t i) {
      const std::uint64_t first = done + i * kChunk;
      partials[i] = {};
      if (first >= count) return;
      source.read(first, kChunk, batches[i]);
      partials[i] = look_at(batches[i], source.info().attributes);
    });
    for (const Partial& p : partials) merge(total, p);
    done = std::min<std::uint64_t>(count, done + kPieces * kChunk);
    report();
  }
  return total;
}

}  // namespace

const char* describe(Defect defect) {
  switch (defect) {
    case Defect::none:
      return "usable";
    case Defect::position:
      return "non-finite position";
    case Defect::normal:
      return "zero or non-finite normal";
    case Defect::radius:
      return "radius not positive";
    case Defect::quality:
      return "quality negative or non-finite";
  }
  return "";
}

Defect defect_of(const SampleBatch& b, std::size_t i) {
  if (!std::isfinite(b.x[i]) || !std::isfinite(b.y[i]) || !std::isfinite(b.z[i])) return Defect::position;
  const double nx = b.nx[i];
  const double ny = b.ny[i];
  const double nz = b.nz[i];
  const double n2 = nx * nx + ny * ny + nz * nz;
  if (!std::isfinite(n2) || n2 < 1e-24) return Defect::normal;
  if (!b.radius.empty() && !(b.radius[i] > 0 && std::isfinite(b.radius[i]))) return Defect::radius;
  if (!b.quality.empty() && !(b.quality[i] >= 0 && std::isfinite(b.quality[i]))) return Defect::quality;
  return Defect::none;
}

namespace {

/// Squares of lengths, and of these in units of a fixed-point step, must neither vanish nor overflow.
constexpr double kLeastExtent = 1e-100;
constexpr double kGreatestExtent = 1e100;

void warn_of_attributes(const std::string& path, const Survey& survey, BadSamples bad, const RunContext& run) {
  if (survey.unusable_attributes == 0) return;
  const std::string what = fmt::format(
      "{}: {} attribute values are NaN or beyond {:g}, the first in row {} "
      "(counted from 0)",
      path, survey.unusable_attributes, kLargestAttribute, survey.first_unusable_attribute);
  if (bad == BadSamples::refuse) {
    throw Error(ExitCode::unreadable, what + "; clean the file or use --bad-samples drop");
  }
  run.warn(what + "; NaN becomes 0, others the nearest usable value");
}

}  // namespace

Survey survey_input(PointSource& source, BadSamples bad, const RunContext& run) {
  PointSourceInfo info = source.info();
  if (info.path == "-") info.path = "standard input";
  if (!info.has_normals) {
    throw Error(ExitCode::unreadable,
                fmt::format("{}: no normals (properties nx ny nz); estimate and orient them first, for example with "
                            "CloudCompare or MeshLab, and save them with the points",
                            info.path));
  }
  if (info.count == 0) throw Error(ExitCode::empty, fmt::format("{}: the file holds no points", info.path));
  const Partial p = look_at_all(source, run);
  Survey survey{p.usable,
                p.rejected,
                p.first_row,
                p.low,
                p.high,
                {},
                p.max_quality,
                p.unusable_attributes,
                p.first_unusable_attribute};
  for (int k = 1; k < kDefects; ++k) {
    if (p.rejected[k] == 0) continue;
    const std::string what =
        fmt::format("{}: {} of {} samples have a {}, the first is row {} (counted from 0)", info.path, p.rejected[k],
                    info.count, describe(static_cast<Defect>(k)), p.first_row[k]);
    if (bad == BadSamples::refuse)
      throw Error(ExitCode::unreadable, what + "; clean the file or use --bad-samples drop");
    run.warn(what + "; dropped");
  }
  warn_of_attributes(info.path, survey, bad, run);
  if (p.usable == 0)
    throw Error(ExitCode::empty, fmt::format("{}: none of its {} samples is usable", info.path, info.count));
  if (info.has_quality && !(p.max_quality > 0)) {
    throw Error(ExitCode::empty, fmt::format("{}: the quality of every sample is 0, so none has a weight; leave the "
                                             "property out or give it values above 0",
                                             info.path));
  }
  const Eigen::Vector3d extent = p.high - p.low;
  if (!(extent.squaredNorm() > kLeastExtent * kLeastExtent)) {
    throw Error(ExitCode::empty,
                fmt::format("{}: {}; a surface needs samples at different places", info.path,
                            p.usable == 1 ? "only one usable sample"
                                          : fmt::format("all {} usable samples lie at one place", p.usable)));
  }
  if (!(extent.maxCoeff() < kGreatestExtent)) {
    throw Error(ExitCode::unreadable, fmt::format("{}: coordinates span {:.3g}, more than can be computed with",
                                                  info.path, extent.maxCoeff()));
  }
  const Eigen::Vector3d mean = p.sum / static_cast<double>(p.usable);
  survey.covariance = p.products / static_cast<double>(p.usable) - mean * mean.transpose();
  return survey;
}

Frame choose_frame(const Survey& survey, FrameMode mode) {
  Frame frame;
  const Eigen::Vector3d extent = survey.high - survey.low;
  frame.origin = survey.low + 0.5 * extent;
  if (mode == FrameMode::pca) {
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(survey.covariance);
    for (int k = 0; k < 3; ++k) {
      Eigen::Vector3d axis = solver.eigenvectors().col(k);  // ascending: the dominant one becomes z
      int largest = 0;
      axis.cwiseAbs().maxCoeff(&largest);
      if (axis[largest] < 0) axis = -axis;
      frame.rotation.row(k) = axis.transpose();
    }
    frame.rotation.row(0) = frame.rotation.row(1).cross(frame.rotation.row(2));
  } else {
    int longest = 0;
    extent.maxCoeff(&longest);
    frame.rotation.setZero();
    for (int k = 0; k < 3; ++k) frame.rotation(k, (longest + 1 + k) % 3) = 1;
  }
  // The diagonal bounds the extent along any axis.
  frame.step = std::exp2(std::ceil(std::log2(extent.norm())) - 30);
  return frame;
}

}  // namespace lamina
