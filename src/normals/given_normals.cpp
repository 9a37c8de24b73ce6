#include "normals/given_normals.h"

#include <tbb/parallel_for.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "samples/sample_tree.h"

namespace lamina {
namespace {

constexpr std::size_t kSeeds = 4096;
constexpr std::size_t kNeighbours = 16;  ///< the sample itself among them
/// Neighbours lie in a plane where they are spread so much less across it than along: two sheets would not be.
constexpr double kFlat = 0.1;
/// A normal that leans more than 45 degrees takes no side.
constexpr double kLeast = 0.7;
/// Shares from which on signs are not believed. Of good normals next to none are odd in a plane, 0.3 % of a scan of
/// trees. Normals turned to one side of a plane have 2 %, where the surface is upright. Noisy normals have no planes:
/// of them more must be odd, and chance lets them fall; between the faces of thin walls as many are, but lie apart.
constexpr double kMostFlat = 0.006, kMost = 0.025, kMostApart = 0.3;
/// And the share of them that lean, where there is a plane, from which on none is believed.
constexpr double kMostLeaning = 0.3;
/// Where neighbours lie in a plane as exactly as this no normal of the surface leans 15 degrees, but those that were
/// interpolated over a flat face, as of eight vertices over a cube's, do.
constexpr double kExactlyFlat = 0.01;
constexpr double kAlongExact = 0.966;
/// Disorder from which on planes through noisy samples are better normals. Of a clean model with a sample for each of
/// its details it is 0.3, of scans with noise of two and three pixels 0.33 and 0.47: normals found are as good as the
/// former and half as far off as the latter.
constexpr double kMostDisorder = 0.4;
constexpr double kLeastSpread = 16;      ///< steps: nearer ones are told apart by rounding, as beside a far outlier
constexpr std::uint64_t kEnough = 1024;  ///< pairs that make a share, samples that have a middle

/// Samples that have a normal, on a lattice.
struct Looked {
  std::array<std::vector<std::int32_t>, 3> at;
  std::vector<Eigen::Vector3f> normal;  ///< of length 1
};

Looked on_lattice(std::span<const Eigen::Vector3d> at, std::span<const Eigen::Vector3f> normals) {
  const auto usable = [&](std::size_t i) {
    const float length = normals[i].norm();
    return at[i].allFinite() && std::isfinite(length) && length > 0;
  };
  Eigen::Vector3d low = Eigen::Vector3d::Constant(std::numeric_limits<double>::max());
  Eigen::Vector3d high = -low;
  for (std::size_t i = 0; i < at.size(); ++i) {
    if (!usable(i)) continue;
    low = low.cwiseMin(at[i]);
    high = high.cwiseMax(at[i]);
  }
  constexpr double kSteps = 1 << 29;
  const double extent = (high - low).maxCoeff();
  Looked out;
  if (!(extent > 0) || !std::isfinite(extent)) return out;
  for (std::size_t i = 0; i < at.size(); ++i) {
    if (!usable(i)) continue;
    const Eigen::Vector3d steps = (at[i] - low) * (kSteps / extent);
    for (int a = 0; a < 3; ++a) out.at[static_cast<std::size_t>(a)].push_back(static_cast<std::int32_t>(steps(a)));
    out.normal.push_back(normals[i].normalized());
  }
  return out;
}

/// Of a sample and its neighbours, how many face to the one side and the other of their plane.
struct Sides {
  std::uint64_t one = 0, other = 0;
  std::uint64_t off = 0;  ///< that lean in an exact plane
  bool in_plane = false, in_exact_plane = false;
  double apart = 0;     ///< GivenNormals::apart
  double disorder = 0;  ///< GivenNormals::disorder
};

Sides sides_around(const Looked& samples, const SampleTree& tree, std::uint32_t place) {
  std::array<Neighbour, kNeighbours - 1> found;
  const std::size_t n = tree.nearest(place, found.size(), std::numeric_limits<float>::infinity(), found.data());
  Sides sides;
  if (n < found.size()) return sides;
  std::array<Eigen::Vector3d, kNeighbours> offsets;
  std::array<std::uint32_t, kNeighbours> numbers{};
  offsets[0].setZero();
  numbers[0] = tree.order()[place];
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < n; ++i) {
    const auto [x, y, z] = tree.offset(place, found[i].sample);
    offsets[i + 1] = Eigen::Vector3f(x, y, z).cast<double>();
    numbers[i + 1] = tree.order()[found[i].sample];
    mean += offsets[i + 1];
  }
  mean /= static_cast<double>(kNeighbours);
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& o : offsets) scatter += (o - mean) * (o - mean).transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(scatter);
  const Eigen::Vector3d across = axes.eigenvectors().col(0);
  Eigen::Matrix3d products = Eigen::Matrix3d::Zero();
  double above = 0, below = 0;  // sums of heights
  for (std::size_t i = 0; i < kNeighbours; ++i) {
    const Eigen::Vector3d normal = samples.normal[numbers[i]].cast<double>();
    const double cosine = across.dot(normal);
    const double height = across.dot(offsets[i]);
    sides.one += cosine > kLeast ? 1 : 0;
    sides.other += cosine < -kLeast ? 1 : 0;
    sides.off += std::abs(cosine) < kAlongExact ? 1 : 0;
    above += cosine > kLeast ? height : 0;
    below += cosine < -kLeast ? height : 0;
    products += normal * normal.transpose();
  }
  if (sides.one > 0 && sides.other > 0) {
    const double deviation = std::sqrt(std::max(axes.eigenvalues()(0), 1.0) / double{kNeighbours});
    sides.apart = (above / static_cast<double>(sides.one) - below / static_cast<double>(sides.other)) / deviation;
  }
  if (axes.eigenvalues()(2) > kNeighbours * kLeastSpread * kLeastSpread) {
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> order(products, Eigen::EigenvaluesOnly);
    sides.disorder = 1 - order.eigenvalues()(2) / double{kNeighbours};
  }
  sides.in_plane = axes.eigenvalues()(0) < kFlat * kFlat * axes.eigenvalues()(1);
  sides.in_exact_plane = axes.eigenvalues()(0) < kExactlyFlat * kExactlyFlat * axes.eigenvalues()(1);
  return sides;
}

}  // namespace

bool GivenNormals::contradict() const {
  return (flat_pairs >= kEnough && flat_share() > kMostFlat) ||
         (pairs >= kEnough && share() > kMost && std::abs(apart) < kMostApart);
}

bool GivenNormals::lean() const {
  const auto most = [](std::uint64_t part, std::uint64_t whole) {
    return whole >= kEnough && static_cast<double>(part) > kMostLeaning * static_cast<double>(whole);
  };
  return most(leaning, in_planes) || most(off, in_exact_planes);
}

bool GivenNormals::scatter() const {
  return disorder > kMostDisorder;
}

GivenNormals look_at_normals(std::span<const Eigen::Vector3d> at, std::span<const Eigen::Vector3f> normals) {
  const Looked samples = on_lattice(at, normals);
  GivenNormals out;
  if (samples.normal.size() <= kNeighbours) return out;
  const SampleTree tree(samples.at[0], samples.at[1], samples.at[2]);
  const std::size_t seeds = std::min(kSeeds, tree.size());
  std::vector<Sides> found(seeds);
  tbb::parallel_for(std::size_t{0}, seeds, [&](std::size_t s) {
    found[s] = sides_around(samples, tree, static_cast<std::uint32_t>(s * tree.size() / seeds));
  });
  std::uint64_t mixed = 0;
  for (const Sides& s : found) {
    const std::uint64_t all = s.one + s.other;
    const std::uint64_t odd = std::min(s.one, s.other);
    out.pairs += all;
    out.odd += odd;
    // Where many lean the normals are not of this plane.
    constexpr std::uint64_t kUpright = kNeighbours * 3 / 4;
    const bool flat = s.in_plane && all >= kUpright;
    out.flat_pairs += flat ? all : 0;
    out.flat_odd += flat ? odd : 0;
    out.in_planes += s.in_plane ? kNeighbours : 0;
    out.leaning += s.in_plane ? kNeighbours - all : 0;
    out.in_exact_planes += s.in_exact_plane ? kNeighbours : 0;
    out.off += s.in_exact_plane ? s.off : 0;
    out.apart += s.apart;
    mixed += odd > 0 ? 1 : 0;
  }
  if (mixed > 0) out.apart /= static_cast<double>(mixed);
  if (seeds >= kEnough) {
    const auto middle = found.begin() + static_cast<std::ptrdiff_t>(seeds / 2);
    std::nth_element(found.begin(), middle, found.end(),
                     [](const Sides& a, const Sides& b) { return a.disorder < b.disorder; });
    out.disorder = middle->disorder;
  }
  return out;
}

}  // namespace lamina
