#include "boundary/fill.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/Geometry>
#include <Eigen/Sparse>
#include <Eigen/SparseCholesky>

namespace lamina::boundary {
namespace {

using Vec3 = Eigen::Vector3d;
using Sparse = Eigen::SparseMatrix<double>;
using Solver = Eigen::SimplicialLDLT<Sparse>;

/// Sums of two cotangents: all positive, so that a membrane stays within its rim, and slivers weigh no more than twenty
/// fair triangles.
constexpr double kLeastWeight = 0.02;
constexpr double kMostWeight = 20;
constexpr int kMembranes = 3;

/// Stiffness of a disc's edges, over all of its vertices.
enum class Weights { even, cotangent };

Sparse stiffness(const Disc& disc, Weights weights) {
  const auto n = static_cast<Eigen::Index>(disc.points.size());
  std::vector<Eigen::Triplet<double>> parts;
  for (const auto& t : disc.triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3 &a = disc.points[t[k]], &b = disc.points[t[(k + 1) % 3]], &c = disc.points[t[(k + 2) % 3]];
      const double area = (b - a).cross(c - a).norm();
      const double along = (b - a).dot(c - a);
      const double cotangent = area > 0 ? along / area : (along > 0 ? kMostWeight : -kMostWeight);
      const int v = static_cast<int>(t[(k + 1) % 3]), w = static_cast<int>(t[(k + 2) % 3]);
      parts.emplace_back(std::min(v, w), std::max(v, w), weights == Weights::even ? 1 : 0.5 * cotangent);
    }
  }
  Sparse edges(n, n);
  edges.setFromTriplets(parts.begin(), parts.end());
  parts.clear();
  for (Eigen::Index k = 0; k < edges.outerSize(); ++k) {
    for (Sparse::InnerIterator e(edges, k); e; ++e) {
      const int v = static_cast<int>(e.row()), w = static_cast<int>(e.col());
      const double weight = std::clamp(e.value(), kLeastWeight, kMostWeight);
      parts.emplace_back(v, v, weight);
      parts.emplace_back(w, w, weight);
      parts.emplace_back(v, w, -weight);
      parts.emplace_back(w, v, -weight);
    }
  }
  Sparse out(n, n);
  out.setFromTriplets(parts.begin(), parts.end());
  return out;
}

/// A third of the triangles around each vertex.
Eigen::VectorXd masses(const Disc& disc) {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(disc.points.size()));
  for (const auto& t : disc.triangles) {
    const Vec3& a = disc.points[t[0]];
    const double third = (disc.points[t[1]] - a).cross(disc.points[t[2]] - a).norm() / 6;
    for (const std::uint32_t v : t) out[v] += third;
  }
  // Where rims turn sharply triangles may have next to no area, which must not count as next to infinite bending.
  const double least = 0.05 * out.mean();
  double shortest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < disc.rim; ++i)
    shortest = std::min(shortest, (disc.points[(i + 1) % disc.rim] - disc.points[i]).squaredNorm());
  return out.cwiseMax(std::clamp(0.05 * shortest, 1e-6 * least, least) + std::numeric_limits<double>::min());
}

Eigen::MatrixXd matrix_of(const Points& points) {
  Eigen::MatrixXd out(static_cast<Eigen::Index>(points.size()), 3);
  for (std::size_t i = 0; i < points.size(); ++i) out.row(static_cast<Eigen::Index>(i)) = points[i];
  return out;
}

/// Splits what belongs to all vertices into rim and new ones.
struct Split {
  explicit Split(const Disc& disc)
      : rim(static_cast<Eigen::Index>(disc.rim)), fresh(static_cast<Eigen::Index>(disc.points.size()) - rim) {}
  Eigen::Index rim, fresh;
};

/// New values that are harmonic for the rim's; nothing where that cannot be solved.
Eigen::MatrixXd harmonic(const Sparse& stiff, const Split& split, const Eigen::MatrixXd& at_rim) {
  const Sparse own = stiff.bottomRightCorner(split.fresh, split.fresh);
  const Sparse others = stiff.bottomLeftCorner(split.fresh, split.rim);
  const Solver solver(own);
  if (solver.info() != Eigen::Success) return {};
  Eigen::MatrixXd out = solver.solve(Eigen::MatrixXd(-(others * at_rim)));
  return out.allFinite() ? out : Eigen::MatrixXd();
}

bool place(const Eigen::MatrixXd& fresh, Disc& disc) {
  if (fresh.size() == 0) return false;
  for (Eigen::Index i = 0; i < fresh.rows(); ++i) disc.points[disc.rim + static_cast<std::size_t>(i)] = fresh.row(i);
  return true;
}

/// The disc stretched over the rim like a membrane, its triangles evened out.
Disc membrane(const Points& rim) {
  Disc disc = nested_rings(rim);
  const auto stretch = [&](Weights weights) {
    const Split split(disc);
    return place(harmonic(stiffness(disc, weights), split, matrix_of(disc.points).topRows(split.rim)), disc);
  };
  stretch(Weights::even);
  for (int i = 0; i < kMembranes; ++i) {
    make_even(disc);
    if (!stretch(Weights::cotangent)) break;
  }
  return disc;
}

/// Closure::width, the influence radius in the disc's unit.
double width_of(const Disc& disc, double radius) {
  double area = 0, length = 0;
  for (const auto& t : disc.triangles) {
    const Vec3& a = disc.points[t[0]];
    area += 0.5 * (disc.points[t[1]] - a).cross(disc.points[t[2]] - a).norm();
  }
  for (std::size_t i = 0; i < disc.rim; ++i) length += (disc.points[(i + 1) % disc.rim] - disc.points[i]).norm();
  return 2 * area / (length * radius);
}

double mean_radius(const Loop& loop) {
  double sum = 0;
  for (const BoundaryVertex& v : loop.vertices) sum += static_cast<double>(v.radius);
  return sum / static_cast<double>(loop.vertices.size());
}

/// Sums over so many values to either side, around a rim.
std::vector<Vec3> sums_along(const std::vector<Vec3>& values, std::size_t window) {
  const std::size_t n = values.size();
  std::vector<Vec3> sums(n + 1, Vec3::Zero());
  for (std::size_t i = 0; i < n; ++i) sums[i + 1] = sums[i] + values[i];
  std::vector<Vec3> out(n);
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t end = i + window + 1;
    const Vec3 upper = sums[std::min(end, n)] + (end > n ? sums[end - n] : Vec3::Zero());
    const Vec3 lower = i >= window ? sums[i - window] : Vec3(sums[i + n - window] - sums[n]);
    out[i] = upper - lower;
  }
  return out;
}

/// How the closure turns off from the surface around, by how it would if it lay flat: both from the continuation of
/// the surface towards its back.
double turn_for(double flat) {
  const double size = std::abs(flat);
  const double turn = size <= kGoesOn ? 0 : std::min((size - kGoesOn) / (kTurnsOff - kGoesOn), 1.0) * kTurnsOff;
  return std::copysign(turn, flat);
}

struct Turns {
  /// At each vertex of the rim by how much the closure is to leave it otherwise than the membrane does: the difference
  /// of their derivatives across the rim, times the length of rim that belongs to the vertex.
  Eigen::MatrixXd at_rim;
  double leads_in = 0;  ///< Closure::leads_in
};

Turns turns(const Loop& loop, const Disc& flat, const Sparse& stiff) {
  const std::size_t n = loop.vertices.size();
  const std::size_t window =
      std::min((n - 1) / 2, std::max<std::size_t>(2, static_cast<std::size_t>(kRimWindow * static_cast<double>(n))));
  // What pulls the membrane's rim inwards is its derivative across the rim.
  const Eigen::MatrixXd pull = -(stiff.topRows(static_cast<Eigen::Index>(n)) * matrix_of(flat.points));
  std::vector<Vec3> inward(n), normal(n), along(n), length(n);
  for (std::size_t i = 0; i < n; ++i) {
    const auto& v = loop.vertices[i].normal;
    inward[i] = pull.row(static_cast<Eigen::Index>(i));
    normal[i] = Vec3(v[0], v[1], v[2]);
    const Vec3 &before = flat.points[(i + n - 1) % n], &here = flat.points[i], &next = flat.points[(i + 1) % n];
    along[i] = 0.5 * (next - before);
    length[i] = Vec3(0.5 * ((next - here).norm() + (here - before).norm()), 0, 0);
    // Normals of the rim's triangles count where the vertices have none.
    if (!(normal[i].squaredNorm() > 0)) normal[i] = Vec3(loop.facing[i][0], loop.facing[i][1], loop.facing[i][2]);
    normal[i] = normal[i].normalized() * along[i].norm();
  }
  inward = sums_along(inward, window);
  normal = sums_along(normal, window);
  along = sums_along(along, window);
  const std::vector<Vec3> own_length = length;
  length = sums_along(length, window);
  std::vector<double> angles(n);
  std::vector<Vec3> onward(n);
  double lying = 0, all = 0;
  for (std::size_t i = 0; i < n; ++i) {
    normal[i].normalize();
    onward[i] = normal[i].cross(along[i]).normalized();
    angles[i] = std::atan2(-inward[i].dot(normal[i]), inward[i].dot(onward[i]));
    lying += own_length[i].x() * std::cos(angles[i]);
    all += own_length[i].x();
  }
  const double leads_in = all > 0 ? lying / all : 0;
  const bool is_sheet = leads_in < kLiesBack;
  std::vector<Vec3> wanted(n);
  for (std::size_t i = 0; i < n; ++i) {
    if (is_sheet && angles[i] < -kTurnsOff / 2) angles[i] = std::numbers::pi;
    const double turn = turn_for(angles[i]);
    wanted[i] = std::cos(turn) * onward[i] - std::sin(turn) * normal[i];
    if (!wanted[i].allFinite()) wanted[i].setZero();
  }
  wanted = sums_along(wanted, window);
  Eigen::MatrixXd out(static_cast<Eigen::Index>(n), 3);
  for (std::size_t i = 0; i < n; ++i) {
    // Of a rim that winds as much counts as it gets on.
    const double straight = along[i].norm();
    const double share = own_length[i].x() / std::max(length[i].x(), std::numeric_limits<double>::min());
    const Vec3 turn = straight * wanted[i].normalized() - inward[i];
    out.row(static_cast<Eigen::Index>(i)) = (turn.allFinite() ? share * turn : Vec3(Vec3::Zero())).transpose();
  }
  return {std::move(out), leads_in};
}

/// Moves the membrane by the displacement of least bending (its bilaplacian over the membrane is zero) whose derivative
/// across the rim is given. Leaves it where it is where that cannot be solved.
void bend(const Eigen::MatrixXd& turns, const Sparse& stiff, Disc& disc) {
  const Split split(disc);
  const Eigen::MatrixXd points = matrix_of(disc.points);
  Eigen::MatrixXd flux = Eigen::MatrixXd::Zero(points.rows(), 3);
  flux.topRows(split.rim) = -turns;
  const Eigen::VectorXd inverse = masses(disc).cwiseInverse();
  const Sparse rows = stiff.bottomRows(split.fresh);
  const Sparse weighted = rows * inverse.asDiagonal();
  const Sparse columns = stiff.rightCols(split.fresh);
  const Solver solver(Sparse(weighted * columns));
  if (solver.info() != Eigen::Success) return;
  const Eigen::MatrixXd moved = solver.solve(Eigen::MatrixXd(weighted * flux));
  // Nothing goes farther than the opening is wide, or it was not solved.
  const double limit = (points.colwise().maxCoeff() - points.colwise().minCoeff()).norm();
  if (!moved.allFinite() || moved.cwiseAbs().maxCoeff() > limit) return;
  place(points.bottomRows(split.fresh) + moved, disc);
}

/// The disc in units of the rim's size, from `origin` on.
Filling filling_of(const Disc& disc, const Vec3& origin, double unit, const Eigen::MatrixXd& attributes) {
  Filling out;
  out.verdict = Verdict::invented;
  out.triangles = disc.triangles;
  const Points normals = normals_around(disc.points, disc.triangles);
  for (std::size_t i = disc.rim; i < disc.points.size(); ++i) {
    const Vec3 p = disc.points[i] * unit + origin;
    const Vec3 n = normals[i].squaredNorm() > 0 ? Vec3(normals[i].normalized()) : Vec3(Vec3::UnitZ());
    out.positions.push_back({p.x(), p.y(), p.z()});
    out.normals.push_back({static_cast<float>(n.x()), static_cast<float>(n.y()), static_cast<float>(n.z())});
    for (Eigen::Index a = 0; a < attributes.cols(); ++a)
      out.attributes.push_back(static_cast<float>(attributes(static_cast<Eigen::Index>(i - disc.rim), a)));
  }
  return out;
}

}  // namespace

Closure close_loop(const Loop& loop) {
  const std::size_t n = loop.vertices.size();
  const auto& first = loop.vertices.front().position;
  const Vec3 origin(first[0], first[1], first[2]);
  Points rim;
  for (const BoundaryVertex& v : loop.vertices)
    rim.push_back(Vec3(v.position[0], v.position[1], v.position[2]) - origin);
  double unit = 0;
  for (const Vec3& p : rim) unit = std::max(unit, p.norm());
  for (Vec3& p : rim) p /= unit;
  Disc disc = membrane(rim);
  const Sparse stiff = stiffness(disc, Weights::cotangent);
  const auto attributes = static_cast<Eigen::Index>(loop.attributes.size() / n);
  const auto given = Eigen::Map<const Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
      loop.attributes.data(), static_cast<Eigen::Index>(n), attributes);
  const Split split(disc);
  Eigen::MatrixXd values(split.fresh, 0);
  if (attributes > 0) {
    values = harmonic(stiff, split, given.cast<double>());
    if (values.size() == 0) values = given.cast<double>().colwise().mean().replicate(split.fresh, 1);
  }
  const double width = width_of(disc, mean_radius(loop) / unit);
  const Turns turned = turns(loop, disc, stiff);
  bend(turned.at_rim, stiff, disc);
  return {filling_of(disc, origin, unit, values), turned.leads_in, width};
}

}  // namespace lamina::boundary
