// Moving least squares by definition, in double over all samples, with a bound on what single precision may add.
// Lengths in cells of the point's level, as in the program, so that the program's rounding can be followed.
#pragma once
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "lattice/lattice.h"
#include "mls/project.h"
#include "store/slab_store.h"

namespace lamina::test {

using Vec3 = std::array<double, 3>;

inline double dot(const Vec3& a, const Vec3& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/// A sample as the method defines it: R = H r, q proportional to quality / r^2, and the size of the cells it asks for.
struct TruthSample {
  Vec3 p, n;           ///< steps
  double support = 0;  ///< R, steps; 0: left out
  double weight = 0;   ///< q
  double cell = 0;     ///< steps
  double band = 0;     ///< steps
  std::vector<double> attributes;
};

/// What a corner or cell centre should hold, in the window's units, each with the error that floats may make.
struct TruthValue {
  double weight = 0;
  int seen = 0;
  double nearest = 1e30;  ///< least (distance / band)^2 over the samples that contribute
  double distance = 0, curvature = 0, offset_from_mean = 0;
  Vec3 from_average{};  ///< the point minus the weighted average of its samples
  Vec3 normal{};
  std::vector<double> attributes;
  double distance_error = 0, curvature_error = 0, offset_error = 0, normal_error = 0;
  std::vector<double> attribute_errors;
  bool undecided = false;  ///< so near a switch (curved or flat, seen or not) that rounding may turn it
};

class MlsTruth {
 public:
  MlsTruth(std::vector<TruthSample> samples, const ProjectSettings& settings)
      : samples_(std::move(samples)), settings_(settings) {}

  /// `at`: steps; `cell`: of the point's level.
  [[nodiscard]] TruthValue value(const Vec3& at, double cell) const {
    Vec3 corner{};
    for (int k = 0; k < 3; ++k) corner[k] = at[k] / cell;
    Vec3 query = corner;
    double query_error = 0;  // cells, any direction
    bool undecided = false;
    Fit fit;
    for (int step = 0; step < settings_.steps; ++step) {
      fit = fit_at(corner, query, cell);
      if (query_error > 0) {
        for (int k = 0; k < 3; ++k) {
          Vec3 moved = query;
          moved[k] += query_error;
          fit.add_difference(fit_at(corner, moved, cell));
        }
      }
      undecided = undecided || fit.undecided;
      if (step + 1 == settings_.steps) break;
      // Farther corners gain nothing from further steps and stay where they are.
      constexpr double kLimit = 1.5;
      if (fit.weight > 0 && std::abs(std::abs(fit.out[0]) - kLimit) <= fit.error[0]) undecided = true;
      if (fit.weight <= 0 || std::abs(fit.out[0]) > kLimit) continue;
      Vec3 next{};
      for (int k = 0; k < 3; ++k) next[k] = corner[k] - fit.out[0] * fit.out[1 + k];
      const double by = std::hypot(next[0] - query[0], next[1] - query[1], next[2] - query[2]);
      const double next_error =
          fit.error[0] + std::abs(fit.out[0]) * (fit.error[1] + fit.error[2] + fit.error[3]) + 16 * kUnit;
      constexpr double kStill = 1e-3;  // points that hardly move stay where they are
      const bool either = std::abs(by - kStill) <= next_error + query_error;
      if (by <= kStill && !either) break;
      query = next;
      query_error = next_error + (either ? kStill : 0);
    }
    TruthValue v;
    v.undecided = undecided;
    v.weight = fit.weight;
    v.seen = fit.seen;
    v.nearest = fit.nearest;
    v.distance = fit.out[0] * cell;
    v.distance_error = fit.error[0] * cell;
    for (int k = 0; k < 3; ++k) {
      v.normal[k] = fit.out[1 + k];
      v.normal_error += fit.error[1 + k];
    }
    v.curvature = fit.out[4] / cell;
    v.curvature_error = fit.error[4] / cell;
    v.offset_from_mean = fit.out[5];
    v.offset_error = fit.error[5];
    for (int k = 0; k < 3; ++k) v.from_average[k] = fit.from_average[k] * cell;
    const std::size_t attributes = samples_.empty() ? 0 : samples_.front().attributes.size();
    v.attributes.assign(fit.out.begin() + 6, fit.out.begin() + 6 + static_cast<std::ptrdiff_t>(attributes));
    v.attribute_errors.assign(fit.error.begin() + 6, fit.error.begin() + 6 + static_cast<std::ptrdiff_t>(attributes));
    return v;
  }

 private:
  static constexpr double kUnit = 0x1p-24;  ///< rounding of a float, relative

  /// Sums of Cuccuru et al. 2009, 3.2, and the sphere fit's about the query point: w, p, n, p.p, p.n, R, attributes.
  using Sums = std::array<double, 13>;
  enum : std::size_t { kSumW = 0, kSumP = 1, kSumN = 4, kSumPP = 7, kSumPN = 8, kSumR = 9, kSumC = 10 };
  /// Distance, normal, curvature, offset, attributes.
  using Outputs = std::array<double, 9>;

  struct Fit {
    double weight = 0;
    int seen = 0;
    double nearest = 1e30;
    Outputs out{}, error{};
    Vec3 from_average{};
    bool undecided = false;
    void add_difference(const Fit& other) {
      undecided = undecided || other.undecided || other.seen != seen || (other.nearest > 1) != (nearest > 1);
      for (std::size_t i = 0; i < out.size(); ++i) error[i] += std::abs(other.out[i] - out[i]);
    }
  };

  /// A direction in which the sums may be wrong, and how far.
  struct Term {
    Sums sums;
    double error;
  };

  struct Shape {
    Outputs out{};
    double slack = 0;  ///< rounding inside the distance's own formula
    bool curved = false, in_reach_of_root = false;
  };

  Shape evaluate(const Sums& s, const Vec3& y) const {
    Shape shape;
    const double w = s[kSumW];
    if (!(w > 0)) return shape;
    const Vec3 a{s[kSumP] / w, s[kSumP + 1] / w, s[kSumP + 2] / w};
    const Vec3 n{s[kSumN] / w, s[kSumN + 1] / w, s[kSumN + 2] / w};
    const double support = s[kSumR] / w;
    const double spread = s[kSumPP] / w - dot(a, a);
    const double u4_curved = (s[kSumPN] / w - dot(n, a)) / (2 * spread);
    shape.curved = settings_.fit == lamina::Fit::sphere && spread > 1e-3 * support * support;
    const double u4 = shape.curved ? u4_curved : 0;
    Vec3 u{};
    for (int k = 0; k < 3; ++k) u[k] = n[k] - 2 * u4 * a[k];
    const double u0 = -(dot(u, a) + u4 * s[kSumPP] / w);
    const double f = u0 + dot(u, y) + u4 * dot(y, y);
    Vec3 g{};
    for (int k = 0; k < 3; ++k) g[k] = u[k] + 2 * u4 * y[k];
    const double length = std::sqrt(dot(g, g));
    if (!(length > 1e-10)) return shape;
    const double disc = dot(g, g) - 4 * u4 * f;
    shape.in_reach_of_root = disc >= 0;
    const double d = disc >= 0 ? 2 * f / (length + std::sqrt(disc)) : f / length;
    shape.out[0] = d;
    Vec3 off{};
    for (int k = 0; k < 3; ++k) {
      shape.out[1 + k] = g[k] / length;
      off[k] = y[k] - d * g[k] / length - a[k];
    }
    shape.out[4] = 2 * u4 / std::sqrt(std::max(dot(u, u) - 4 * u0 * u4, 1e-20));
    shape.out[5] = std::sqrt(dot(off, off)) / support;
    for (std::size_t c = kSumC; c < s.size(); ++c) shape.out[6 + c - kSumC] = s[c] / w;
    double terms = std::abs(u4) * (s[kSumPP] / w + dot(y, y));
    for (int k = 0; k < 3; ++k) terms += std::abs(u[k] * a[k]) + std::abs(u[k] * y[k]);
    shape.slack = 16 * kUnit * terms / length;
    return shape;
  }

  Fit fit_at(const Vec3& corner, const Vec3& query, double cell) const {
    const std::size_t attributes = samples_.empty() ? 0 : samples_.front().attributes.size();
    Sums sums{};
    Sums magnitude{};
    Sums error{};
    std::vector<Term> terms;
    Fit fit;
    for (const TruthSample& s : samples_) {
      if (s.support <= 0) continue;
      const double support = s.support / cell;
      Vec3 d{};
      double delta = 0;  // error of an offset: the sample's place in a tile and the difference, in floats
      for (int k = 0; k < 3; ++k) {
        d[k] = s.p[k] / cell - query[k];
        delta = std::max(delta, kUnit * (2 * (12 + support) + std::abs(d[k])));
      }
      const double d2 = dot(d, d);
      const double d2_error = 2 * (std::abs(d[0]) + std::abs(d[1]) + std::abs(d[2])) * delta + 4 * kUnit * d2;
      const double t = 1 - d2 / (support * support);
      const double t_error = d2_error / (support * support) + 6 * kUnit;
      if (std::abs(t) <= t_error) fit.undecided = true;
      if (t <= 0) continue;
      ++fit.seen;
      const double band = s.band / cell;
      const double nearest = d2 / (band * band);
      if (std::abs(nearest - 1) <= d2_error / (band * band) + 6 * kUnit) fit.undecided = true;
      fit.nearest = std::min(fit.nearest, nearest);
      const double w = s.weight * t * t * t * t;
      Term term{{}, 4 * t_error / t + 12 * kUnit};
      const auto add = [&](std::size_t i, double value, double value_error) {
        term.sums[i] = w * value;
        sums[i] += w * value;
        magnitude[i] += std::abs(w * value);
        error[i] += w * value_error + kUnit * std::abs(w * value);
      };
      add(kSumW, 1, 0);
      for (std::size_t k = 0; k < 3; ++k) {
        add(kSumP + k, d[k], delta);
        add(kSumN + k, s.n[k], kUnit);
      }
      add(kSumPP, d2, d2_error);
      const double pn_terms = std::abs(d[0] * s.n[0]) + std::abs(d[1] * s.n[1]) + std::abs(d[2] * s.n[2]);
      add(kSumPN, dot(d, s.n), 2 * delta + 4 * kUnit * pn_terms);
      add(kSumR, support, 2 * kUnit * support);
      for (std::size_t c = 0; c < attributes; ++c) add(kSumC + c, s.attributes[c], kUnit * std::abs(s.attributes[c]));
      terms.push_back(std::move(term));
    }
    // Summing, and what the fit loses in its first differences (spread, co, u).
    for (std::size_t i = 0; i < sums.size(); ++i) error[i] += (fit.seen + 8) * kUnit * magnitude[i];
    const double w = sums[kSumW];
    fit.weight = w;
    if (w > 0) {
      const auto length = [&](std::size_t i) { return std::hypot(sums[i], sums[i + 1], sums[i + 2]); };
      error[kSumPN] += 8 * kUnit * length(kSumP) * length(kSumN) / w;
    }
    // A wrong weight moves all sums together; everything else moves them one by one.
    for (std::size_t i = 0; i < sums.size(); ++i) {
      if (error[i] <= 0) continue;
      terms.push_back({{}, error[i]});
      terms.back().sums[i] = 1;
    }
    Vec3 y{};
    for (int k = 0; k < 3; ++k) y[k] = corner[k] - query[k];
    const Shape shape = evaluate(sums, y);
    fit.out = shape.out;
    for (std::size_t k = 0; w > 0 && k < 3; ++k) fit.from_average[k] = y[k] - sums[kSumP + k] / w;
    for (const Term& term : terms) {
      for (const double sign : {-1.0, 1.0}) {
        Sums moved = sums;
        for (std::size_t i = 0; i < sums.size(); ++i) moved[i] += sign * term.error * term.sums[i];
        const Shape other = evaluate(moved, y);
        if (other.curved != shape.curved || other.in_reach_of_root != shape.in_reach_of_root) fit.undecided = true;
        for (std::size_t o = 0; o < fit.out.size(); ++o) fit.error[o] += std::abs(other.out[o] - fit.out[o]);
      }
    }
    fit.error[0] += shape.slack + 8 * kUnit * std::abs(fit.out[0]);
    for (std::size_t o = 1; o < fit.out.size(); ++o) fit.error[o] += 8 * kUnit * std::abs(fit.out[o]);
    for (std::size_t k = 1; k <= 3; ++k) fit.error[k] += 4 * kUnit;
    fit.error[5] += 16 * kUnit;
    return fit;
  }

  std::vector<TruthSample> samples_;
  ProjectSettings settings_;
};

/// The samples of a cloud with given radii, none of them too large for the coarsest level.
inline std::vector<TruthSample> truth_samples(const LocalSamples& s, const Lattice& lattice,
                                              const FeedSettings& settings) {
  std::vector<TruthSample> out;
  for (std::size_t i = 0; i < s.size(); ++i) {
    TruthSample t;
    t.p = {static_cast<double>(s.x[i]), static_cast<double>(s.y[i]), static_cast<double>(s.z[i])};
    t.n = {s.nx[i], s.ny[i], s.nz[i]};
    const double r = s.radius[i];
    if (settings.max_radius <= 0 || r <= settings.max_radius) t.support = r * settings.blend;
    t.weight = (s.quality.empty() ? 1.0 : s.quality[i]) / (r * r) * 1e4;
    const double wanted = settings.cell_ratio() * (settings.cell_follows_support() ? r * settings.blend : r);
    t.cell = lattice.cell_size(0);
    for (int level = 1; !settings.fixed_cell() && level < lattice.levels && lattice.cell_size(level) <= wanted;
         ++level) {
      t.cell = lattice.cell_size(level);
    }
    t.band = std::max(static_cast<double>(settings.band_cells) * t.cell, static_cast<double>(settings.band_radii) * r);
    for (const auto& a : s.attributes) t.attributes.push_back(a[i]);
    out.push_back(std::move(t));
  }
  return out;
}

}  // namespace lamina::test
