#include "samples/stray_tests.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>

namespace lamina {
namespace {

/// Most samples are on a surface beyond doubt, and a dozen of them together tell so without a search: their mean normal
/// is so long, each lies within this cosine of it, none is farther from their middle than so many times (squared) the
/// usual, and none farther from their plane than this share (squared) of it.
constexpr float kPlainAgreement = 0.9F;
constexpr float kPlainCosine = 0.6F;
constexpr float kPlainSpread = 4;
constexpr float kPlainThickness = 0.25F;
/// Fewer lie on one plane by chance.
constexpr std::size_t kLeastPlain = 6;

/// Mean scatter from which on samples fill space.
/// With normals: of outliers all over a box one mean in a hundred is less than 0.43, whatever a choice among them has
/// left; of the sparse samples of scans one in a hundred is more than 0.23 to 0.43.
constexpr float kDisordered = 0.42F;
/// Without: a dozen by chance have 0.3 (one such mean in a hundred less than 0.25), those along a right edge 0.1, those
/// of a surface under noise of a third of the spacing 0.06, of half 0.14.
constexpr float kThick = 0.22F;

/// A place and its company, from their middle.
using Around = Eigen::Matrix<float, 3, kStrayNeighbours + 1>;

Around around_of(const Placed& s, std::size_t place, const Company& company) {
  Around at = Around::Zero();
  for (std::size_t k = 0; k < company.count; ++k) {
    const std::size_t n = company.places[k];
    at.col(static_cast<Eigen::Index>(k) + 1) << static_cast<float>(s.x[n] - s.x[place]),
        static_cast<float>(s.y[n] - s.y[place]), static_cast<float>(s.z[n] - s.z[place]);
  }
  const auto all = static_cast<Eigen::Index>(company.count) + 1;
  at.leftCols(all).colwise() -= at.leftCols(all).rowwise().mean().eval();
  return at;
}

/// The normal of a sample's surface. One that was found is its own and its neighbours', half and half: it comes from so
/// few positions that their noise turns it.
std::array<float, 3> normal_at(const Placed& s, std::size_t place, const Company& company, SampleNormals normals) {
  const std::array<float, 3> own{s.nx[place], s.ny[place], s.nz[place]};
  if (normals == SampleNormals::given) return own;
  const auto all = static_cast<float>(company.count);
  std::array<float, 3> sum{all * own[0], all * own[1], all * own[2]};
  for (std::size_t i = 0; i < company.count; ++i) {
    const std::size_t n = company.places[i];
    const std::array<float, 3> its{s.nx[n], s.ny[n], s.nz[n]};
    const float way = own[0] * its[0] + own[1] * its[1] + own[2] * its[2] < 0 ? -1.0F : 1.0F;
    for (std::size_t k = 0; k < 3; ++k) sum[k] += way * its[k];
  }
  const float length = std::sqrt(sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2]);
  return {sum[0] / length, sum[1] / length, sum[2] / length};
}

}  // namespace

bool is_off_surface(const Placed& s, std::size_t place, const Company& company, float least, SampleNormals normals) {
  if (company.count == 0) return true;
  const std::array<float, 3> normal = normal_at(s, place, company, normals);
  std::array<float, kStrayNeighbours> off;
  float farthest2 = 0;
  for (std::size_t i = 0; i < company.count; ++i) {
    const std::size_t n = company.places[i];
    const auto dx = static_cast<float>(s.x[n] - s.x[place]);
    const auto dy = static_cast<float>(s.y[n] - s.y[place]);
    const auto dz = static_cast<float>(s.z[n] - s.z[place]);
    off[i] = std::abs(dx * normal[0] + dy * normal[1] + dz * normal[2]);
    farthest2 = std::max(farthest2, dx * dx + dy * dy + dz * dz);
  }
  const float limit = kNearPlane * std::sqrt(farthest2);
  const float exact_limit = kOnPlane * std::sqrt(farthest2);
  std::size_t exact = 0;
  std::size_t along = 0;  // its surface, facing its way
  std::size_t against = 0;
  std::array<float, 3> mean{};  // of all neighbours' normals
  for (std::size_t i = 0; i < company.count; ++i) {
    const std::size_t n = company.places[i];
    const float cosine = s.nx[n] * normal[0] + s.ny[n] * normal[1] + s.nz[n] * normal[2];
    exact += off[i] <= exact_limit && cosine > kSameWay ? 1 : 0;
    along += off[i] <= limit && cosine > kAlongSurface ? 1 : 0;
    against += off[i] <= limit && cosine < -kAlongSurface ? 1 : 0;
    mean[0] += s.nx[n];
    mean[1] += s.ny[n];
    mean[2] += s.nz[n];
  }
  const auto all = static_cast<float>(company.count);
  const float agreement = std::sqrt(mean[0] * mean[0] + mean[1] * mean[1] + mean[2] * mean[2]) / all;
  // Neighbours that do not agree among themselves say nothing of the way a sample faces.
  if (agreement < kAgreeing) along += against;
  return static_cast<float>(along) < least * all && static_cast<float>(exact) < kLeastExact * all;
}

bool is_off_plane(const Placed& s, std::size_t place, const Company& company, float least) {
  if (company.count < 3) return company.count == 0;  // three points lie on a plane whatever they are
  const Around at = around_of(s, place, company);
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3f> solver;
  solver.computeDirect(at * at.transpose());
  const Eigen::Vector3f normal = solver.eigenvectors().col(0);
  float farthest2 = 0;
  std::array<float, kStrayNeighbours> off;
  for (std::size_t k = 0; k < company.count; ++k) {
    const Eigen::Vector3f from = at.col(static_cast<Eigen::Index>(k) + 1) - at.col(0);
    off[k] = std::abs(normal.dot(from));
    farthest2 = std::max(farthest2, from.squaredNorm());
  }
  const auto within = [&](float share) {
    const float limit = share * std::sqrt(farthest2);
    return static_cast<float>(
        std::count_if(off.begin(), off.begin() + company.count, [&](float d) { return d <= limit; }));
  };
  const auto found = static_cast<float>(company.count);
  return within(kNearPlane) < least * found && within(kOnPlane) < kLeastExact * found;
}

float thickness_of(const Placed& s, std::size_t place, const Company& company) {
  if (company.count < kStrayNeighbours) return -1;
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3f> solver;
  const Around at = around_of(s, place, company);
  solver.computeDirect(at * at.transpose(), Eigen::EigenvaluesOnly);
  const Eigen::Vector3f along = solver.eigenvalues();
  return along[2] > 0 ? std::max(along[0], 0.0F) / along[2] : 0;
}

float scatter_of(const Placed& s, std::size_t place, const Company& company, SampleNormals normals) {
  if (normals == SampleNormals::none) return thickness_of(s, place, company);
  if (company.count < kStrayNeighbours) return -1;
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3f> solver;
  Around facing;
  facing.col(0) << s.nx[place], s.ny[place], s.nz[place];
  for (std::size_t k = 0; k < company.count; ++k) {
    const std::size_t n = company.places[k];
    facing.col(static_cast<Eigen::Index>(k) + 1) << s.nx[n], s.ny[n], s.nz[n];
  }
  solver.computeDirect(facing * facing.transpose(), Eigen::EigenvaluesOnly);
  return 1 - solver.eigenvalues()[2] / static_cast<float>(facing.cols());
}

bool fills_space(const Surroundings& known, std::size_t place, const Company& company, SampleNormals normals) {
  float sum = known.scatter[place];
  if (sum < 0) return false;
  float count = 1;
  for (std::size_t k = 0; k < company.count; ++k) {
    const float its = known.scatter[company.places[k]];
    if (its < 0) continue;
    sum += its;
    ++count;
  }
  return sum > (normals != SampleNormals::none ? kDisordered : kThick) * count;
}

void doubt_all(const Placed& /*samples*/, const SampleLeaf& leaf, std::uint8_t* doubtful) {
  std::fill_n(doubtful, leaf.size(), std::uint8_t{1});
}

void find_doubtful(const Placed& s, const SampleLeaf& leaf, std::uint8_t* doubtful) {
  std::fill_n(doubtful, leaf.size(), std::uint8_t{1});
  if (leaf.size() < kLeastPlain) return;
  const auto count = static_cast<float>(leaf.size());
  std::array<float, 3> middle{};
  std::array<float, 3> normal{};
  const auto at = [&](std::size_t i) {
    return std::array<float, 3>{static_cast<float>(s.x[i] - s.x[leaf.begin]),
                                static_cast<float>(s.y[i] - s.y[leaf.begin]),
                                static_cast<float>(s.z[i] - s.z[leaf.begin])};
  };
  for (std::size_t i = leaf.begin; i < leaf.end; ++i) {
    const std::array<float, 3> p = at(i);
    for (std::size_t k = 0; k < 3; ++k) middle[k] += p[k] / count;
    normal[0] += s.nx[i] / count;
    normal[1] += s.ny[i] / count;
    normal[2] += s.nz[i] / count;
  }
  const float length = std::sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]);
  if (length < kPlainAgreement) return;
  std::array<float, Neighbourhoods::kMostInLeaf> away{};
  float sum2 = 0;
  float thickest = 0;
  for (std::size_t i = leaf.begin; i < leaf.end; ++i) {
    const std::array<float, 3> p = at(i);
    float d2 = 0;
    float off = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const float d = p[k] - middle[k];
      d2 += d * d;
      off += d * normal[k];
    }
    if (s.nx[i] * normal[0] + s.ny[i] * normal[1] + s.nz[i] * normal[2] < kPlainCosine * length) return;
    away[i - leaf.begin] = d2;
    sum2 += d2;
    thickest = std::max(thickest, std::abs(off));
  }
  const float mean2 = sum2 / count;
  if (thickest * thickest > kPlainThickness * mean2 * length * length) return;
  for (std::size_t i = 0; i < leaf.size(); ++i) doubtful[i] = away[i] > kPlainSpread * mean2 ? 1 : 0;
}

}  // namespace lamina
