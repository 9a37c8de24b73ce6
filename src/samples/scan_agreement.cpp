#include "samples/scan_agreement.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "base/vectors.h"
#include "samples/sample_tree.h"

namespace lamina {
namespace {

/// Neighbours among the places that tell how densely they lie.
constexpr std::size_t kPlacesAround = 8;
/// A place is at most so many times as wide as most are.
constexpr double kWidest = 4;
/// Weights of distances are found again so many times.
constexpr int kRounds = 5;
/// 1.4826 medians of distances are a deviation of normally distributed ones.
constexpr double kDeviation = 1.4826;

double median_size(std::vector<double> values) {
  for (double& v : values) v = std::abs(v);
  return median_of(values);
}

/// How far scan a lies above scan b, and how that changes with their motions: six numbers, of a's and, with the other
/// sign, of b's.
using Row = Eigen::Matrix<double, 6, 1>;

}  // namespace

struct ScanAgreement::Pair {
  std::uint32_t a = 0, b = 0;
  double distance = 0;
  Row change;
  [[nodiscard]] double after(const Eigen::VectorXd& motions) const {
    return distance + change.dot(motions.segment<6>(6 * std::ptrdiff_t{a}) - motions.segment<6>(6 * std::ptrdiff_t{b}));
  }
};

ScanAgreement::ScanAgreement(std::span<const OrientedPoint> places, double samples, std::size_t scans) : scans_(scans) {
  for (const OrientedPoint& p : places) middle_ += p.at / static_cast<double>(places.size());
  double squared = 0;
  for (const OrientedPoint& p : places) {
    places_.push_back({p.at - middle_, p.normal.normalized(), 0, {}});
    squared += places_.back().at.squaredNorm();
  }
  if (squared > 0) spread_ = std::sqrt(squared / static_cast<double>(places.size()));
  choose_radii(samples);
  fill_cells();
}

/// As wide as kCompared samples lie, by the places around, which lie as much less densely as they are fewer.
void ScanAgreement::choose_radii(double samples) {
  double farthest = 0;
  for (const Place& p : places_) farthest = std::max(farthest, p.at.cwiseAbs().maxCoeff());
  if (!(farthest > 0)) return;
  constexpr double kSteps = 1 << 29;
  const double steps = kSteps / farthest;
  std::array<std::vector<std::int32_t>, 3> at;
  for (const Place& p : places_) {
    for (int a = 0; a < 3; ++a) at[static_cast<std::size_t>(a)].push_back(static_cast<std::int32_t>(p.at[a] * steps));
  }
  const SampleTree tree(at[0], at[1], at[2]);
  const double wider = std::sqrt(kCompared / kPlacesAround * static_cast<double>(places_.size()) / samples);
  std::vector<double> radii;
  std::array<Neighbour, kPlacesAround> found;
  for (std::uint32_t i = 0; i < tree.size(); ++i) {
    const std::size_t n = tree.nearest(i, kPlacesAround, std::numeric_limits<float>::max(), found.data());
    Place& place = places_[tree.order()[i]];
    if (n == kPlacesAround) place.radius = wider * std::sqrt(double{found[n - 1].squared}) / steps;
    radii.push_back(place.radius);
  }
  radius_ = median_of(radii);
  for (Place& p : places_) p.radius = std::min(p.radius, kWidest * radius_);
}

void ScanAgreement::fill_cells() {
  if (!(radius_ > 0)) return;
  inverse_cell_ = 0.5 / radius_;
  for (std::uint32_t i = 0; i < places_.size(); ++i) {
    const Place& p = places_[i];
    const auto cell = [&](double v) { return static_cast<std::int64_t>(std::floor(v * inverse_cell_)); };
    for (std::int64_t z = cell(p.at.z() - p.radius); z <= cell(p.at.z() + p.radius); ++z) {
      for (std::int64_t y = cell(p.at.y() - p.radius); y <= cell(p.at.y() + p.radius); ++y) {
        for (std::int64_t x = cell(p.at.x() - p.radius); x <= cell(p.at.x() + p.radius); ++x)
          cells_[{x, y, z}].push_back(i);
      }
    }
  }
}

void ScanAgreement::add(const OrientedPoint& sample, std::size_t scan) {
  const Eigen::Vector3d c = (sample.at * inverse_cell_).array().floor();
  const Cell cell{static_cast<std::int64_t>(c.x()), static_cast<std::int64_t>(c.y()), static_cast<std::int64_t>(c.z())};
  if (cell != last_cell_) {  // seldom: a scan's samples come in rows
    const auto found = cells_.find(cell);
    reaching_ = found == cells_.end() ? nullptr : &found->second;
    last_cell_ = cell;
  }
  if (reaching_ == nullptr) return;
  constexpr double kFacing = 0.5;
  for (const std::uint32_t i : *reaching_) {
    Place& place = places_[i];
    const Eigen::Vector3d from = sample.at - place.at;
    const double near = 1 - from.squaredNorm() / (place.radius * place.radius);
    if (!(near > 0) || sample.normal.dot(place.normal) < kFacing) continue;
    auto sums = std::find_if(place.scans.begin(), place.scans.end(), [&](const ScanSums& s) { return s.scan == scan; });
    if (sums == place.scans.end())
      sums = place.scans.insert(sums, {static_cast<std::uint32_t>(scan), 0, 0, {0, 0, 0}, {0, 0, 0}});
    const double weight = near * near;
    ++sums->count;
    sums->weight += weight;
    sums->at += weight * from;
    sums->normal += weight * sample.normal;
  }
}

/// Of two scans at a place the distance between their means along the mean of both normals: on a surface that bends the
/// errors of the two tangent planes cancel (Rusinkiewicz, A symmetric objective function for ICP, 2019).
std::vector<ScanAgreement::Pair> ScanAgreement::pairs() const {
  std::vector<Pair> out;
  const auto tells = [](const ScanSums& s) {
    return s.count >= kLeastCompared && s.normal.squaredNorm() > kOneSheet * kOneSheet * s.weight * s.weight;
  };
  for (const Place& place : places_) {
    for (std::size_t i = 0; i < place.scans.size(); ++i) {
      const ScanSums& a = place.scans[i];
      if (!tells(a)) continue;
      for (std::size_t j = 0; j < i; ++j) {
        const ScanSums& b = place.scans[j];
        if (!tells(b)) continue;
        const Eigen::Vector3d na = a.normal.normalized();
        const Eigen::Vector3d nb = b.normal.normalized();
        if (na.dot(nb) < kSameSheet) continue;
        const Eigen::Vector3d normal = (na + nb).normalized();
        const Eigen::Vector3d apart = a.at / a.weight - b.at / b.weight;
        const double distance = apart.dot(normal);
        if ((apart - distance * normal).norm() > kBesideEachOther * place.radius) continue;
        const Eigen::Vector3d at = place.at + 0.5 * (a.at / a.weight + b.at / b.weight);
        Row change;
        change << at.cross(normal) / spread_, normal;
        out.push_back({a.scan, b.scan, distance, change});
      }
    }
  }
  return out;
}

/// Motions of all scans, six numbers each: a rotation times spread_, and a shift. The sum of their squares is made
/// small, too, with the weight of one place: that keeps scans where no other tells anything, and the cloud as a whole.
Eigen::VectorXd ScanAgreement::least_squares(const std::vector<Pair>& pairs, const std::vector<double>& rest) const {
  const double limit = kFarOff * kDeviation * median_size(rest);
  const auto n = 6 * static_cast<std::ptrdiff_t>(scans_);
  Eigen::MatrixXd a = Eigen::MatrixXd::Identity(n, n);
  Eigen::VectorXd b = Eigen::VectorXd::Zero(n);
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const Pair& pair = pairs[i];
    const double share = rest[i] / limit;
    if (!(share * share < 1)) continue;
    const double weight = (1 - share * share) * (1 - share * share);
    const Eigen::Matrix<double, 6, 6> square = weight * pair.change * pair.change.transpose();
    const Row side = weight * pair.distance * pair.change;
    const std::ptrdiff_t p = 6 * std::ptrdiff_t{pair.a};
    const std::ptrdiff_t q = 6 * std::ptrdiff_t{pair.b};
    a.block<6, 6>(p, p) += square;
    a.block<6, 6>(q, q) += square;
    a.block<6, 6>(p, q) -= square;
    a.block<6, 6>(q, p) -= square;
    b.segment<6>(p) -= side;
    b.segment<6>(q) += side;
  }
  return a.ldlt().solve(b);
}

Agreement ScanAgreement::solve() const {
  const std::vector<Pair> compared = pairs();
  Agreement out;
  out.places = compared.size();
  out.motions.resize(scans_);
  std::vector<double> rest;
  rest.reserve(compared.size());
  for (const Pair& p : compared) rest.push_back(p.distance);
  out.before = out.after = median_size(rest);
  if (!(out.before > 0)) return out;
  Eigen::VectorXd motions;
  for (int round = 0; round < kRounds; ++round) {
    motions = least_squares(compared, rest);
    for (std::size_t i = 0; i < compared.size(); ++i) rest[i] = compared[i].after(motions);
  }
  out.after = median_size(rest);
  for (std::size_t s = 0; s < scans_; ++s) {
    const Row motion = motions.segment<6>(6 * static_cast<std::ptrdiff_t>(s));
    const Eigen::Vector3d about = motion.head<3>() / spread_;
    if (about.norm() > 0) out.motions[s].turn = Eigen::AngleAxisd(about.norm(), about.normalized()).toRotationMatrix();
    out.motions[s].shift = motion.tail<3>();
  }
  return out;
}

}  // namespace lamina
