// A range scanner over a known mesh, with what goes wrong in real scans. Written without any of the library's scanner,
// whose views are parallel and whose samples are clean.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>
#include <utility>
#include <vector>

#include "lamina/mesh.h"
#include "measure/triangle_bvh.h"
#include "meshes/vec3.h"
#include "reconstruct/clouds.h"

namespace lamina::test::scenes {

using namespace meshes;

/// An image of distances: in perspective, or all around with rows of equal elevation.
struct ScannerView {
  Vec3 eye{}, right{}, up{}, ahead{};
  int columns = 0, rows = 0;
  double reach = 0;  ///< tangent of half the width in perspective; all around the highest elevation, radians
  bool all_around = false;

  [[nodiscard]] Vec3 ray(double column, double row) const {
    if (!all_around) {
      const double step = 2 * reach / columns;
      return unit(ahead + ((column - columns * 0.5) * step) * right + ((row - rows * 0.5) * step) * up);
    }
    const double turn = 2 * std::numbers::pi * column / columns, rise = (2 * row / rows - 1) * reach;
    return (std::cos(rise) * std::cos(turn)) * right + (std::cos(rise) * std::sin(turn)) * ahead + std::sin(rise) * up;
  }
  /// The distance of neighbouring rays at a depth.
  [[nodiscard]] double spacing(double depth) const {
    return depth * (all_around ? 2 * std::numbers::pi / columns : 2 * reach / columns);
  }
  [[nodiscard]] bool holds(const Vec3& towards) const {
    if (all_around) return std::abs(std::asin(std::clamp(dot(unit(towards), up), -1.0, 1.0))) <= reach;
    const double depth = dot(towards, ahead);
    return depth > 0 && std::abs(dot(towards, right)) <= depth * reach &&
           std::abs(dot(towards, up)) <= depth * reach * rows / columns;
  }
};

inline ScannerView look_at(const Vec3& eye, const Vec3& target, const Vec3& top, int columns, int rows, double reach) {
  const Vec3 ahead = unit(target - eye), right = unit(cross(ahead, top));
  return {eye, right, cross(right, ahead), ahead, columns, rows, reach, false};
}

inline ScannerView look_around(const Vec3& eye, int columns, double elevation) {
  const int rows = static_cast<int>(columns * elevation / std::numbers::pi);
  return {eye, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, columns, rows, elevation, true};
}

/// Views from all sides of a ball, square, from three of its radii away.
inline std::vector<ScannerView> views_around(const Vec3& centre, double radius, int views, int columns) {
  std::vector<ScannerView> result;
  for (int i = 0; i < views; ++i) {
    const double z = 1 - (2 * i + 1.0) / views, across = std::sqrt(1 - z * z), turn = i * 2.399963;
    const Vec3 eye = centre + (3 * radius) * Vec3{across * std::cos(turn), across * std::sin(turn), z};
    result.push_back(look_at(eye, centre, std::abs(z) < 0.9 ? Vec3{0, 0, 1} : Vec3{1, 0, 0}, columns, columns, 0.36));
  }
  return result;
}

/// Lengths in spacings: the median distance of neighbouring rays where they hit.
struct ScannerErrors {
  double noise = 0;            ///< standard deviation along the ray
  double misregistration = 0;  ///< each scan but the first is shifted, and turned by as much at the scene's rim
  double flying = 0;           ///< share of returns at a jump of depth that lie between the two depths instead
  double outliers = 0;         ///< points anywhere in the scene's box, for each point
  int window = 1;              ///< normals come from the neighbours in the image as far as this
};

struct SceneScan {
  Cloud cloud;
  std::vector<std::size_t> begins;  ///< first sample of each view; outliers are behind the last
  double spacing = 0;
  std::vector<Vec3> places;  ///< evenly over the truth
  std::vector<Vec3> seen;    ///< those of them that some view sees
};

class SceneScanner {
 public:
  SceneScanner(const TriangleMesh& truth, std::vector<ScannerView> views, const ScannerErrors& errors)
      : truth_(truth), tree_(truth), views_(std::move(views)), errors_(errors) {
    const measure::Bounds box = measure::triangle_bounds(truth);
    low_ = box.low;
    high_ = box.high;
  }

  /// `places`: how many places of the truth it tells of.
  SceneScan scan(std::size_t places) {
    std::vector<double> spacings;
    for (const ScannerView& view : views_) images_.push_back(look(view, spacings));
    std::nth_element(spacings.begin(), spacings.begin() + static_cast<long>(spacings.size() / 2), spacings.end());
    SceneScan result;
    result.spacing = spacing_ = spacings[spacings.size() / 2];
    for (std::size_t i = 0; i < views_.size(); ++i) {
      result.begins.push_back(result.cloud.size());
      add_returns(i, result.cloud);
    }
    add_outliers(result.cloud);
    find_seen_places(places, result);
    return result;
  }

 private:
  static constexpr double kGrazing = 0.26;  // cosine of 75 degrees
  static constexpr double kJump = 6;        // spacings: a jump between neighbouring depths
  static constexpr double kLostAtJumps = 0.5;

  struct Return {
    double truth = 0;  ///< depth where the ray hits; 0: nowhere
    double depth = 0;  ///< as measured; 0: no return
    Vec3 position{};
  };
  using Image = std::vector<Return>;

  [[nodiscard]] Vec3 face_normal(std::uint32_t triangle) const {
    const auto& t = truth_.triangles[triangle];
    const Vec3& a = truth_.positions[t[0]];
    return unit(cross(truth_.positions[t[1]] - a, truth_.positions[t[2]] - a));
  }
  double uniform() { return std::uniform_real_distribution<>()(random_); }

  [[nodiscard]] Image look(const ScannerView& view, std::vector<double>& spacings) const {
    Image image;
    for (int row = 0; row < view.rows; ++row) {
      for (int column = 0; column < view.columns; ++column) {
        Return& r = image.emplace_back();
        const Vec3 ray = view.ray(column, row);
        const auto hit = tree_.first_hit(view.eye, ray);
        if (!hit) continue;
        r.truth = hit->distance;
        if (std::abs(dot(face_normal(hit->triangle), ray)) < kGrazing) continue;
        r.depth = hit->distance;
        spacings.push_back(view.spacing(r.depth));
      }
    }
    return image;
  }

  /// The neighbour's depth that differs most from the own one, where that is a jump; else 0.
  [[nodiscard]] static double depth_across_a_jump(const Image& image, const ScannerView& view, int column, int row) {
    const double here = image[static_cast<std::size_t>(row * view.columns + column)].truth;
    double farthest = kJump * view.spacing(here), other = 0;
    for (const auto& [dx, dy] : {std::pair{-1, 0}, {1, 0}, {0, -1}, {0, 1}}) {
      const int x = view.all_around ? (column + dx + view.columns) % view.columns : column + dx, y = row + dy;
      if (x < 0 || x >= view.columns || y < 0 || y >= view.rows) continue;
      const double there = image[static_cast<std::size_t>(y * view.columns + x)].truth;
      if (there <= 0 || std::abs(there - here) <= farthest) continue;
      farthest = std::abs(there - here);
      other = there;
    }
    return other;
  }

  /// Least squares over the image's neighbours this side of a jump; zero where there are too few.
  [[nodiscard]] Vec3 image_normal(const Image& image, const ScannerView& view, int column, int row) const {
    const Return& own = image[static_cast<std::size_t>(row * view.columns + column)];
    double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0, syy = 0;
    Vec3 sum{}, sum_x{}, sum_y{};
    for (int dy = -errors_.window; dy <= errors_.window; ++dy) {
      for (int dx = -errors_.window; dx <= errors_.window; ++dx) {
        const int x = view.all_around ? (column + dx + view.columns) % view.columns : column + dx, y = row + dy;
        if (x < 0 || x >= view.columns || y < 0 || y >= view.rows) continue;
        const Return& r = image[static_cast<std::size_t>(y * view.columns + x)];
        const double allowed = kJump * view.spacing(own.depth) * std::max({1, std::abs(dx), std::abs(dy)});
        if (r.depth <= 0 || std::abs(r.depth - own.depth) > allowed) continue;
        n += 1;
        sx += dx, sy += dy, sxx += dx * dx, sxy += dx * dy, syy += dy * dy;
        sum = sum + r.position;
        sum_x = sum_x + double(dx) * r.position;
        sum_y = sum_y + double(dy) * r.position;
      }
    }
    if (n < 3) return {};
    const double a = sxx - sx * sx / n, b = sxy - sx * sy / n, c = syy - sy * sy / n;
    if (a * c - b * b < 0.2) return {};
    const Vec3 u = sum_x - (sx / n) * sum, v = sum_y - (sy / n) * sum;
    return unit(cross(c * u - b * v, a * v - b * u));
  }

  void measure_depths(std::size_t number) {
    const ScannerView& view = views_[number];
    const Image clean = images_[number];
    std::normal_distribution<> bell;
    for (int row = 0; row < view.rows; ++row) {
      for (int column = 0; column < view.columns; ++column) {
        Return& r = images_[number][static_cast<std::size_t>(row * view.columns + column)];
        if (r.truth <= 0) continue;
        if (const double other = depth_across_a_jump(clean, view, column, row); other > 0) {
          const double luck = uniform();
          if (luck < errors_.flying)
            r.depth = r.truth + (other - r.truth) * uniform();
          else if (luck < errors_.flying + kLostAtJumps)
            r.depth = 0;
        }
        if (r.depth <= 0) continue;
        r.depth += errors_.noise * spacing_ * bell(random_);
        r.position = view.eye + r.depth * view.ray(column, row);
      }
    }
  }

  void add_returns(std::size_t number, Cloud& cloud) {
    measure_depths(number);
    const ScannerView& view = views_[number];
    const Image& image = images_[number];
    const Vec3 centre = 0.5 * (low_ + high_);
    const double error = number == 0 ? 0 : errors_.misregistration * spacing_;
    const Vec3 axis = random_direction(random_), shift = (error * (0.5 + uniform())) * random_direction(random_);
    const double angle = error / (0.5 * norm(high_ - low_)) * (0.5 + uniform());
    const auto turned = [&](const Vec3& v) {
      return std::cos(angle) * v + std::sin(angle) * cross(axis, v) + (dot(axis, v) * (1 - std::cos(angle))) * axis;
    };
    for (int row = 0; row < view.rows; ++row) {
      for (int column = 0; column < view.columns; ++column) {
        const Return& r = image[static_cast<std::size_t>(row * view.columns + column)];
        if (r.depth <= 0) continue;
        const Vec3 back = unit(view.eye - r.position);
        Vec3 normal = image_normal(image, view, column, row);
        if (norm(normal) == 0) normal = back;
        if (dot(normal, back) < 0) normal = -1.0 * normal;
        cloud.add(centre + turned(r.position - centre) + shift, turned(normal));
      }
    }
  }

  void add_outliers(Cloud& cloud) {
    const auto count = static_cast<std::size_t>(errors_.outliers * static_cast<double>(cloud.size()));
    for (std::size_t i = 0; i < count; ++i) {
      Vec3 p{};
      for (std::size_t a = 0; a < 3; ++a) p[a] = low_[a] + (1.2 * uniform() - 0.1) * (high_[a] - low_[a]);
      cloud.add(p, random_direction(random_));
    }
  }

  void find_seen_places(std::size_t places, SceneScan& result) {
    const AreaSampler sampler(truth_);
    for (std::size_t i = 0; i < places; ++i) {
      const double share = (static_cast<double>(i) + uniform()) / static_cast<double>(places), v = uniform();
      const SurfacePoint place = sampler.at(share, v, uniform());
      const Vec3 p = position_at(truth_, place), normal = face_normal(place.triangle);
      result.places.push_back(p);
      const bool seen = std::any_of(views_.begin(), views_.end(), [&](const ScannerView& view) {
        const Vec3 towards = p - view.eye;
        if (!view.holds(towards) || std::abs(dot(normal, unit(towards))) < kGrazing) return false;
        const auto hit = tree_.first_hit(view.eye, unit(towards));
        return !hit || hit->distance > norm(towards) * (1 - 1e-6);
      });
      if (seen) result.seen.push_back(p);
    }
  }

  const TriangleMesh& truth_;
  measure::TriangleBvh tree_;
  std::vector<ScannerView> views_;
  ScannerErrors errors_;
  Vec3 low_{}, high_{};
  double spacing_ = 0;
  std::vector<Image> images_;
  std::mt19937 random_{1};
};

}  // namespace lamina::test::scenes
