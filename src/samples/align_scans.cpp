#include "lamina/align.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "lamina/error.h"
#include "samples/scan_agreement.h"
#include "store/ingest.h"

namespace lamina {
namespace {

/// Places whose scans are compared: of the cloud's rows one in so many that there are no more.
constexpr std::uint64_t kMostPlaces = 1 << 14;
constexpr std::uint64_t kRowsRead = 1 << 15;  ///< read at once
constexpr std::size_t kMostScans = 128;       ///< their motions are found together, in a square of six times as many
constexpr int kMostPasses = 3;

/// Pairs of scans at places that tell of a motion, and how many times as many as it has numbers.
constexpr std::size_t kLeastPlaces = 200;
/// The share of the distance between scans that must go, beyond what chance takes away.
constexpr double kLeastGain = 0.03;
/// After motions of more than this, in radii of a place, scans are compared anew.
constexpr double kSmallMotion = 0.15;

/// Which scan each row of a source belongs to.
class ScanOfRow {
 public:
  explicit ScanOfRow(const PointSourceInfo& info) : parts_(info.scans) {
    if (parts_.size() > 1) return;
    attribute_ = find_attribute(info.attributes, "scan");
  }
  [[nodiscard]] bool told() const { return parts_.size() > 1 || attribute_; }
  [[nodiscard]] std::size_t scans() const { return parts_.size() > 1 ? parts_.size() : values_.size(); }
  /// Where an attribute tells scans, every value of it is to be met once.
  void meet(const SampleBatch& batch, std::size_t i) {
    if (!attribute_ || parts_.size() > 1 || values_.size() > kMostScans) return;
    const float value = batch.attributes[*attribute_][i];
    const auto at = std::lower_bound(values_.begin(), values_.end(), value);
    if (std::isfinite(value) && (at == values_.end() || *at != value)) values_.insert(at, value);
  }
  /// Nothing: of a scan that was not met.
  [[nodiscard]] std::optional<std::size_t> of(const SampleBatch& batch, std::size_t i) const {
    if (parts_.size() > 1) {
      const auto next = std::upper_bound(parts_.begin(), parts_.end(), batch.first + i,
                                         [](std::uint64_t row, const ScanPart& scan) { return row < scan.first; });
      return static_cast<std::size_t>(next - parts_.begin()) - 1;
    }
    const auto at = std::lower_bound(values_.begin(), values_.end(), batch.attributes[*attribute_][i]);
    if (at == values_.end() || *at != batch.attributes[*attribute_][i]) return std::nullopt;
    return static_cast<std::size_t>(at - values_.begin());
  }

 private:
  std::vector<ScanPart> parts_;
  std::optional<std::size_t> attribute_;
  std::vector<float> values_;  ///< ascending
};

OrientedPoint point_of(const SampleBatch& batch, std::size_t i) {
  return {{batch.x[i], batch.y[i], batch.z[i]},
          Eigen::Vector3f(batch.nx[i], batch.ny[i], batch.nz[i]).cast<double>().normalized()};
}

/// Calls visit(batch) for all rows of a source in turn.
template <class Visit>
void for_rows(PointSource& source, const RunContext& run, const Visit& visit) {
  SampleBatch batch;
  for (std::uint64_t first = 0; first < source.info().count; first += kRowsRead) {
    if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
    source.read(first, kRowsRead, batch);
    visit(batch);
    if (run.progress) run.progress({"align", first + batch.size(), source.info().count, 0, 0});
  }
}

/// Evenly spaced rows, as far as they are usable; their scans are met.
std::vector<OrientedPoint> choose_places(PointSource& source, ScanOfRow& scan, const RunContext& run) {
  const std::uint64_t step = (source.info().count + kMostPlaces - 1) / kMostPlaces;
  std::vector<OrientedPoint> places;
  for_rows(source, run, [&](const SampleBatch& batch) {
    for (std::uint64_t i = (step - batch.first % step) % step; i < batch.size(); i += step) {
      const auto k = static_cast<std::size_t>(i);
      if (defect_of(batch, k) != Defect::none) continue;
      places.push_back(point_of(batch, k));
      scan.meet(batch, k);
    }
  });
  return places;
}

/// The source with every scan moved.
class AlignedPoints final : public PointSource {
 public:
  AlignedPoints(std::unique_ptr<PointSource> source, ScanOfRow scan, std::vector<RigidMotion> motions)
      : source_(std::move(source)), scan_(std::move(scan)), motions_(std::move(motions)) {
    info_ = source_->info();
  }
  void read(std::uint64_t first, std::size_t count, SampleBatch& out) override {
    source_->read(first, count, out);
    for (std::size_t i = 0; i < out.size(); ++i) {
      const std::optional<std::size_t> scan = scan_.of(out, i);
      if (!scan) continue;
      const RigidMotion& motion = motions_[*scan];
      const Eigen::Vector3d at = motion({out.x[i], out.y[i], out.z[i]});
      const Eigen::Vector3f n = motion.turn.cast<float>() * Eigen::Vector3f(out.nx[i], out.ny[i], out.nz[i]);
      out.x[i] = at.x();
      out.y[i] = at.y();
      out.z[i] = at.z();
      out.nx[i] = n.x();
      out.ny[i] = n.y();
      out.nz[i] = n.z();
    }
  }

 private:
  std::unique_ptr<PointSource> source_;
  ScanOfRow scan_;
  std::vector<RigidMotion> motions_;
};

/// What is to be done about a source's scans: passes over its samples until motions are small.
class Alignment {
 public:
  Alignment(PointSource& source, const ScanOfRow& scan, const RunContext& run)
      : source_(source), scan_(scan), run_(run), motions_(scan.scans()) {}

  void find(const std::vector<OrientedPoint>& places) {
    for (int pass = 0; pass < kMostPasses; ++pass) {
      ScanAgreement agreement(places, static_cast<double>(source_.info().count), scan_.scans());
      middle_ = agreement.middle();
      look(agreement);
      const Agreement found = agreement.solve();
      if (pass == 0) first_ = found;
      if (!is_gain(found)) return;
      after_ = found.after;
      double farthest = 0;
      for (std::size_t s = 0; s < motions_.size(); ++s) {
        const RigidMotion& by = found.motions[s];
        motions_[s] = {by.turn * motions_[s].turn, by(motions_[s].shift)};
        farthest = std::max(farthest, farthest_moved(by, places));
      }
      if (farthest < kSmallMotion * agreement.radius()) return;
    }
  }

  [[nodiscard]] ScanAlignment told(const std::vector<OrientedPoint>& places) const {
    ScanAlignment told{scan_.scans(), first_.places, first_.before, after_.value_or(first_.before), 0};
    for (const RigidMotion& by : motions_) told.farthest = std::max(told.farthest, farthest_moved(by, places));
    return told;
  }
  /// In input coordinates.
  [[nodiscard]] std::vector<RigidMotion> motions() const {
    std::vector<RigidMotion> out = motions_;
    for (RigidMotion& m : out) m.shift += middle_ - m.turn * middle_;
    return out;
  }

 private:
  [[nodiscard]] double farthest_moved(const RigidMotion& by, const std::vector<OrientedPoint>& places) const {
    double farthest = 0;
    for (const OrientedPoint& p : places) farthest = std::max(farthest, (by(p.at - middle_) - (p.at - middle_)).norm());
    return farthest;
  }
  void look(ScanAgreement& agreement) {
    for_rows(source_, run_, [&](const SampleBatch& batch) {
      for (std::size_t i = 0; i < batch.size(); ++i) {
        const std::optional<std::size_t> scan = scan_.of(batch, i);
        if (!scan || defect_of(batch, i) != Defect::none) continue;
        OrientedPoint p = point_of(batch, i);
        p.at = motions_[*scan](p.at - middle_);
        p.normal = motions_[*scan].turn * p.normal;
        agreement.add(p, *scan);
      }
    });
  }
  /// Motions of scans that agree take away what chance gives them: of the square a share of one for each number.
  [[nodiscard]] bool is_gain(const Agreement& found) const {
    if (found.places < kLeastPlaces) return false;
    const double chance = 6 * static_cast<double>(scan_.scans()) / static_cast<double>(found.places);
    return found.after < (1 - kLeastGain - chance) * found.before;
  }

  PointSource& source_;
  const ScanOfRow& scan_;
  const RunContext& run_;
  std::vector<RigidMotion> motions_;  ///< so far, relative to the middle
  Eigen::Vector3d middle_ = Eigen::Vector3d::Zero();
  Agreement first_;
  std::optional<double> after_;
};

}  // namespace

std::unique_ptr<PointSource> align_scans(std::unique_ptr<PointSource> source, ScanAlignment& found,
                                         const RunContext& run) {
  found = {};
  ScanOfRow scan(source->info());
  if (!scan.told() || !source->info().has_normals || source->info().from_above || scan.scans() > kMostScans)
    return source;
  const std::vector<OrientedPoint> places = choose_places(*source, scan, run);
  if (scan.scans() < 2 || scan.scans() > kMostScans || places.empty()) return source;
  Alignment alignment(*source, scan, run);
  alignment.find(places);
  found = alignment.told(places);
  if (!found.moved()) return source;
  return std::make_unique<AlignedPoints>(std::move(source), std::move(scan), alignment.motions());
}

}  // namespace lamina
