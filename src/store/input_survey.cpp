#include "store/ingest.h"

#include <fmt/format.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "lamina/error.h"

namespace lamina {
namespace {

constexpr std::size_t kSurveyRows = 1u << 16;  ///< rows a piece; fixed, so sums do not depend on the number of threads

/// A piece's census, and its moments about its own first sample, where they cannot cancel.
struct Partial {
  Census census;
  Eigen::Vector3d pivot = Eigen::Vector3d::Zero();
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  Eigen::Matrix3d products = Eigen::Matrix3d::Zero();
};

Partial look_at(const SampleBatch& batch, const AttributeLayout& layout, const RowPick& pick) {
  Partial p;
  Census& c = p.census;
  c.count_attributes(batch, layout);
  for (std::size_t i = 0; i < batch.size(); ++i) {
    if (!c.takes(pick, batch, i)) continue;
    const Defect defect = defect_of(batch, i);
    if (defect != Defect::none) {
      c.reject(defect, batch.first + i);
      continue;
    }
    const Eigen::Vector3d x(batch.x[i], batch.y[i], batch.z[i]);
    if (c.usable++ == 0) p.pivot = x;
    const Eigen::Vector3d d = x - p.pivot;
    c.low = c.low.cwiseMin(x);
    c.high = c.high.cwiseMax(x);
    p.sum += d;
    p.products += d * d.transpose();
    if (!batch.quality.empty()) c.max_quality = std::max(c.max_quality, batch.quality[i]);
  }
  return p;
}

/// Adds piece `b` to `a`, moving its moments to the pivot of `a`.
void merge(Partial& a, const Partial& b) {
  if (b.census.usable > 0) {
    if (a.census.usable == 0) a.pivot = b.pivot;
    const Eigen::Vector3d s = b.pivot - a.pivot;
    const auto n = static_cast<double>(b.census.usable);
    a.products += b.products + s * b.sum.transpose() + b.sum * s.transpose() + n * s * s.transpose();
    a.sum += b.sum + n * s;
  }
  a.census.merge(b.census);
}

Survey survey_of(const Partial& p) {
  Survey survey;
  static_cast<Census&>(survey) = p.census;
  if (p.census.usable == 0) return survey;
  const Eigen::Vector3d mean = p.sum / static_cast<double>(p.census.usable);
  survey.covariance = p.products / static_cast<double>(p.census.usable) - mean * mean.transpose();
  return survey;
}

Partial look_at_all(PointSource& source, const RunContext& run, const RowPick& pick) {
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
      source.read(done, kSurveyRows, batch);
      merge(total, look_at(batch, source.info().attributes, pick));
      done = std::min<std::uint64_t>(count, done + kSurveyRows);
      report();
    }
    return total;
  }
  constexpr std::size_t kPieces = 16;
  tbb::enumerable_thread_specific<SampleBatch> batches;
  std::array<Partial, kPieces> partials;
  while (done < count) {
    tbb::parallel_for(std::size_t{0}, kPieces, [&](std::size_t i) {
      const std::uint64_t first = done + i * kSurveyRows;
      partials[i] = {};
      if (first >= count) return;
      SampleBatch& batch = batches.local();
      source.read(first, kSurveyRows, batch);
      partials[i] = look_at(batch, source.info().attributes, pick);
    });
    for (const Partial& p : partials) merge(total, p);
    done = std::min<std::uint64_t>(count, done + kPieces * kSurveyRows);
    report();
  }
  return total;
}

/// Squares of lengths, and of these in units of a fixed-point step, must neither vanish nor overflow.
constexpr double kLeastExtent = 1e-100;
constexpr double kGreatestExtent = 1e100;

bool makes_a_frame(const Census& c) {
  if (c.usable == 0) return false;
  const Eigen::Vector3d extent = c.high - c.low;
  return extent.squaredNorm() > kLeastExtent * kLeastExtent && extent.maxCoeff() < kGreatestExtent;
}

}  // namespace

void Census::reject(Defect defect, std::uint64_t row) {
  const auto k = static_cast<std::size_t>(defect);
  if (rejected[k]++ == 0) first_row[k] = row;
}

bool Census::takes(const RowPick& pick, const SampleBatch& batch, std::size_t i) {
  if (pick.takes_all()) return true;
  const Pick judged = judge(pick, batch, i, batch.first + i);
  skipped += judged == Pick::skipped ? 1 : 0;
  clipped += judged == Pick::clipped ? 1 : 0;
  return judged == Pick::taken;
}

void Census::count_attributes(const SampleBatch& batch, const AttributeLayout& layout) {
  for (std::size_t c = 0; c < batch.attributes.size(); ++c) {
    if (layout[c].type != ScalarType::float32 && layout[c].type != ScalarType::float64) continue;  // always in range
    const std::vector<float>& values = batch.attributes[c];
    const auto bad = [](float v) { return !(std::abs(v) <= kLargestAttribute); };
    const auto count = static_cast<std::uint64_t>(std::count_if(values.begin(), values.end(), bad));
    if (count == 0) continue;
    const auto at = std::find_if(values.begin(), values.end(), bad) - values.begin();
    const std::uint64_t row = batch.first + static_cast<std::uint64_t>(at);
    first_unusable_attribute = unusable_attributes == 0 ? row : std::min(row, first_unusable_attribute);
    unusable_attributes += count;
  }
}

void Census::merge(const Census& later) {
  for (std::size_t k = 0; k < kDefects; ++k) {
    if (rejected[k] == 0) first_row[k] = later.first_row[k];
    rejected[k] += later.rejected[k];
  }
  if (unusable_attributes == 0) first_unusable_attribute = later.first_unusable_attribute;
  unusable_attributes += later.unusable_attributes;
  max_quality = std::max(max_quality, later.max_quality);
  usable += later.usable;
  clipped += later.clipped;
  skipped += later.skipped;
  low = low.cwiseMin(later.low);
  high = high.cwiseMax(later.high);
}

Pick judge(const RowPick& pick, const SampleBatch& batch, std::size_t i, std::uint64_t row) {
  if (pick.every > 1 && row % pick.every != 0) return Pick::skipped;
  if (!pick.clip) return Pick::taken;
  const std::array<double, 3> p{batch.x[i], batch.y[i], batch.z[i]};
  for (std::size_t k = 0; k < 3; ++k) {
    // Not-a-number lies nowhere, and is somebody else's to count.
    if (p[k] < pick.clip->low[k] || p[k] > pick.clip->high[k]) return Pick::clipped;
  }
  return Pick::taken;
}

const char* reason_of(Defect defect, const PointSourceInfo& source) {
  switch (defect) {
    case Defect::none:
      return "usable";
    case Defect::position:
      return "non-finite position";
    case Defect::normal:
      return source.found_normals ? "normal that its neighbours do not tell" : "zero or non-finite normal";
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
  if (!std::isfinite(n2) || n2 < kLeastNormalSquared) return Defect::normal;
  if (!b.radius.empty() && !(b.radius[i] > 0 && std::isfinite(b.radius[i]))) return Defect::radius;
  if (!b.quality.empty() && !(b.quality[i] >= 0 && std::isfinite(b.quality[i]))) return Defect::quality;
  return Defect::none;
}

namespace {

void warn_of_attributes(const std::string& path, const Census& census, BadSamples bad, const RunContext& run) {
  if (census.unusable_attributes == 0) return;
  const std::string what = fmt::format(
      "{}: {} attribute values are NaN or beyond {:g}, the first in row {} "
      "(counted from 0)",
      path, census.unusable_attributes, kLargestAttribute, census.first_unusable_attribute);
  if (bad == BadSamples::refuse) {
    throw Error(ExitCode::unreadable, what + "; clean the file or use --bad-samples drop");
  }
  run.warn(what + "; NaN becomes 0, others the nearest usable value");
}

std::string name_of(const PointSourceInfo& source) {
  return source.path == "-" ? "standard input" : source.path;
}

}  // namespace

void require_samples(const PointSourceInfo& source) {
  if (source.count == 0) throw Error(ExitCode::empty, fmt::format("{}: the file holds no points", name_of(source)));
  if (!source.has_normals) {
    throw Error(ExitCode::unreadable,
                fmt::format("{}: no normals (properties nx ny nz); --normals auto finds and orients them, see also "
                            "`lamina normal`",
                            name_of(source)));
  }
}

void judge(const Census& c, const PointSourceInfo& source, BadSamples bad, const RunContext& run) {
  const std::string path = name_of(source);
  for (int k = 1; k < kDefects; ++k) {
    if (c.rejected[k] == 0) continue;
    const auto defect = static_cast<Defect>(k);
    // A file is not to blame for normals it does not have; whoever looked for them has said how many found none.
    if (defect == Defect::normal && source.found_normals) continue;
    const std::string what = fmt::format("{}: {} of {} samples have a {}, the first is row {} (counted from 0)", path,
                                         c.rejected[k], source.count, reason_of(defect, source), c.first_row[k]);
    if (bad == BadSamples::refuse)
      throw Error(ExitCode::unreadable, what + "; clean the file or use --bad-samples drop");
    run.warn(what + "; dropped");
  }
  warn_of_attributes(path, c, bad, run);
  if (c.usable == 0 && c.clipped > 0)
    throw Error(ExitCode::empty,
                fmt::format("{}: none of its {} samples lies in the box to clip to", path, source.count));
  const bool none_has_normal = c.rejected[static_cast<int>(Defect::normal)] == source.count;
  if (none_has_normal && source.found_normals)
    throw Error(ExitCode::empty, fmt::format("{}: none of its {} samples has a normal that its neighbours tell: they "
                                             "are too few, or all on a line",
                                             path, source.count));
  if (none_has_normal)
    throw Error(ExitCode::empty,
                fmt::format("{}: none of its {} samples has a normal that is not zero; --normals auto finds and "
                            "orients them, see also `lamina normal`",
                            path, source.count));
  if (c.usable == 0)
    throw Error(ExitCode::empty, fmt::format("{}: none of its {} samples is usable", path, source.count));
  if (source.has_quality && !(c.max_quality > 0))
    run.warn(fmt::format("{}: the quality of every sample is 0, which tells no weights; not used", path));
  if (makes_a_frame(c)) return;
  const Eigen::Vector3d extent = c.high - c.low;
  if (!(extent.squaredNorm() > kLeastExtent * kLeastExtent)) {
    throw Error(ExitCode::empty,
                fmt::format("{}: {}; a surface needs samples at different places", path,
                            c.usable == 1 ? "only one usable sample"
                                          : fmt::format("all {} usable samples lie at one place", c.usable)));
  }
  throw Error(ExitCode::unreadable,
              fmt::format("{}: coordinates span {:.3g}, more than can be computed with", path, extent.maxCoeff()));
}

Survey survey_input(PointSource& source, BadSamples bad, const RunContext& run, const RowPick& pick) {
  require_samples(source.info());
  Survey survey = survey_of(look_at_all(source, run, pick));
  judge(survey, source.info(), bad, run);
  return survey;
}

std::optional<Survey> survey_part(PointSource& source, const RowPick& pick) {
  // Runs of rows from all over the file: whatever order the rows are in, all of the cloud is looked at.
  constexpr std::uint64_t kRuns = 256;
  constexpr std::uint64_t kRows = 1024;
  const std::uint64_t count = source.info().count;
  if (!source.info().random_access || count < 2 * kRuns * kRows) return std::nullopt;
  std::array<Partial, kRuns> partials;
  tbb::parallel_for(std::size_t{0}, std::size_t{kRuns}, [&](std::size_t i) {
    SampleBatch batch;
    // The first run begins with the first row, the last one ends with the last.
    const auto share = static_cast<double>(i) / static_cast<double>(kRuns - 1);
    const auto first = static_cast<std::uint64_t>(share * static_cast<double>(count - kRows));
    source.read(first, kRows, batch);
    partials[i] = look_at(batch, source.info().attributes, pick);
  });
  Partial total;
  for (const Partial& p : partials) merge(total, p);
  if (!makes_a_frame(total.census)) return std::nullopt;
  const double share = static_cast<double>(total.census.usable) / static_cast<double>(kRuns * kRows);
  Survey survey = survey_of(total);
  survey.usable = static_cast<std::uint64_t>(share * static_cast<double>(count));
  return survey;
}

namespace {

/// Floors, plinths and facades lie across the axes of what they belong to, and one of them would fill a slab. A few
/// degrees spread it over some hundred.
Eigen::Matrix3d tilt() {
  constexpr double kAboutX = 0.06, kAboutY = 0.04;
  return (Eigen::AngleAxisd(kAboutX, Eigen::Vector3d::UnitX()) * Eigen::AngleAxisd(kAboutY, Eigen::Vector3d::UnitY()))
      .toRotationMatrix();
}

}  // namespace

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
    frame.rotation = tilt() * frame.rotation;
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
