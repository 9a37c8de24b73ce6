#include "mls/refit_normals.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <tuple>

#include <Eigen/Core>

#include "lattice/lattice.h"
#include "mls/row_samples.h"
#include "samples/consensus_plane.h"

namespace lamina {

/// A bucket with the normals it came with.
struct RefitNormals::Added {
  ActiveBucket bucket;  // no attributes
  std::shared_ptr<const ClusteredBucket> clustered;
  std::int32_t low = 0, high = 0;  // z
};

namespace {

/// A sample in its tile, by rows of cells.
struct Placed {
  Block block;
  std::uint16_t row;
  std::uint32_t sample;
  [[nodiscard]] auto key() const { return std::tuple(block.z, block.y, block.x, row, sample); }
};

struct TileSpan {
  std::size_t begin, end;  // of the placed samples
};

std::vector<Placed> place(const LocalSamples& s, std::int32_t cell) {
  const FloorDivider divide(cell);
  std::vector<Placed> out(s.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, s.size(), kSampleGrain), [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) {
      const std::array<std::int32_t, 3> c{divide(s.x[i]), divide(s.y[i]), divide(s.z[i])};
      // Cubes of two cells, so that successive samples see about the same rows.
      const int row = ((c[2] & 7) >> 1) * 16 + ((c[1] & 7) >> 1) * 4 + ((c[0] & 7) >> 1);
      out[i] = {{c[0] >> 3, c[1] >> 3, c[2] >> 3}, static_cast<std::uint16_t>(row), static_cast<std::uint32_t>(i)};
    }
  });
  std::sort(out.begin(), out.end(), [](const Placed& a, const Placed& b) { return a.key() < b.key(); });
  return out;
}

/// Of the sphere around a sample, or its own where there is none.
struct FittedNormal {
  std::array<float, 3> normal{};
  float residual = 0;  ///< how far outside of the sphere the sample lies, cells
  float variance = 0;  ///< of the normals around, of length one
  bool fitted = false;
};

struct Scratch {
  RowSamples rows;
  std::vector<FittedNormal> wide;  ///< of a tile
  std::array<SampleRange, RowSamples::kRows> ranges{};
  ConsensusPlane plane;
};

/// Of normals whose angles have that median: each of two components is the median over 1.18 (Rayleigh's distribution).
float variance_of(float median_angle) {
  constexpr float kMedianOfRayleigh = 1.1774F;
  const float deviation = median_angle / kMedianOfRayleigh;
  return 2 * deviation * deviation;
}

/// One tile's fits.
class TileRefit {
 public:
  TileRefit(const Kernel& kernel, const RefitSettings& settings, const ActiveBucket& bucket, Scratch& scratch,
            FilteredNormals& out)
      : kernel_(kernel),
        only_blurred_(settings.only_blurred),
        noise_variance_(2 * variance_of(settings.noise)),
        s_(bucket.samples),
        support_(bucket.support),
        scratch_(scratch),
        out_(out) {}

  /// Of the samples of a block of cells so large.
  void fit(const Block& block, std::int32_t cell, std::span<const Placed> placed) {
    const std::uint32_t edge = 8U * static_cast<std::uint32_t>(cell);
    origin_ = {static_cast<std::uint32_t>(block.x) * edge, static_cast<std::uint32_t>(block.y) * edge,
               static_cast<std::uint32_t>(block.z) * edge};
    inv_ = 1.0F / static_cast<float>(cell);
    const auto in_eights = [&](auto one) {
      for (std::size_t i = 0; i < placed.size(); i += kLanes)
        (this->*one)(placed.subspan(i, std::min<std::size_t>(kLanes, placed.size() - i)), i);
    };
    if (only_blurred_) {
      in_eights(&TileRefit::sharpen_eight);
      return;
    }
    scratch_.wide.resize(placed.size());
    in_eights(&TileRefit::fit_wide);
    scratch_.rows.scale_supports(kNarrow);
    in_eights(&TileRefit::fit_narrow);
  }

 private:
  using Point = std::array<float, 3>;

  /// Up to eight samples' places and normals, and the ranges of samples around them.
  struct Eight {
    Queries at{}, facing{};
    int ranges = 0;
    std::array<Lanes, kSums> sums{};
  };
  Eight eight(std::span<const Placed> placed) {
    Eight e;
    for (int l = 0; l < kLanes; ++l) {
      const std::uint32_t i = placed[std::min(static_cast<std::size_t>(l), placed.size() - 1)].sample;
      e.at.x[l] = relative(s_.x[i], 0);
      e.at.y[l] = relative(s_.y[i], 1);
      e.at.z[l] = relative(s_.z[i], 2);
      e.facing.x[l] = s_.nx[i];
      e.facing.y[l] = s_.ny[i];
      e.facing.z[l] = s_.nz[i];
    }
    const auto [y_lo, y_hi] = extremes_of(e.at.y);
    const auto [z_lo, z_hi] = extremes_of(e.at.z);
    e.ranges = scratch_.rows.ranges(y_lo, y_hi, z_lo, z_hi, scratch_.ranges.data());
    e.sums[kNearest].v.fill(1e30F);
    return e;
  }
  void sharpen_eight(std::span<const Placed> placed, std::size_t /*first*/) {
    Eight e = eight(placed);
    kernel_.accumulate(scratch_.rows.samples(), scratch_.ranges.data(), e.ranges, e.at, e.sums.data());
    for (std::size_t k = 0; k < placed.size(); ++k) {
      const int l = static_cast<int>(k);
      sharpen(placed[k].sample, {e.at.x[l], e.at.y[l], e.at.z[l]}, e.ranges, mean_of_normals(e.sums.data(), l));
    }
  }
  /// The spheres' normals; those without a fit keep their own.
  template <typename Take>
  void fit_eight(std::span<const Placed> placed, const Take& take) {
    Eight e = eight(placed);
    kernel_.accumulate_facing(scratch_.rows.samples(), scratch_.ranges.data(), e.ranges, e.at, e.facing, e.sums.data());
    FitOutput fit{};
    kernel_.fit(e.sums.data(), FitInput{}, fit);
    for (std::size_t k = 0; k < placed.size(); ++k) {
      const int l = static_cast<int>(k);
      const Point own = normal_of(placed[k].sample);
      const Point found{fit.nx[l], fit.ny[l], fit.nz[l]};
      const float along = found[0] * own[0] + found[1] * own[1] + found[2] * own[2];
      const bool keep = !(along > 0) || e.sums[kSeen][l] < kLeastRefitSamples;
      take(k, FittedNormal{keep ? own : found, keep ? 0.0F : fit.distance[l], 1 - mean_of_normals(e.sums.data(), l),
                           !keep});
    }
  }
  void fit_wide(std::span<const Placed> placed, std::size_t first) {
    fit_eight(placed, [&](std::size_t k, const FittedNormal& f) {
      scratch_.wide[first + k] = f;
      out_.residual[placed[k].sample] = f.residual / inv_;
    });
  }
  /// Where the wide fit is not the best for all of the eight; settles their normals.
  void fit_narrow(std::span<const Placed> placed, std::size_t first) {
    const auto wide = std::span(scratch_.wide).subspan(first, placed.size());
    if (std::all_of(wide.begin(), wide.end(), [&](const FittedNormal& w) { return share_of_detail(w) == 0; })) {
      for (std::size_t k = 0; k < placed.size(); ++k) put(placed[k].sample, wide[k].normal);
      return;
    }
    fit_eight(placed, [&](std::size_t k, const FittedNormal& narrow) {
      const std::uint32_t i = placed[k].sample;
      put(i, mixed(wide[k], narrow, normal_of(i)));
    });
  }
  [[nodiscard]] static float mean_of_normals(const Lanes* sums, int l) {
    const float x = sums[kNx][l];
    const float y = sums[kNy][l];
    const float z = sums[kNz][l];
    return (x * x + y * y + z * z) / std::max(1e-30F, sums[kW][l] * sums[kW][l]);
  }
  /// The wide fit, the narrow one or the normal that came, as the normals around vary.
  [[nodiscard]] Point mixed(const FittedNormal& wide, const FittedNormal& narrow, const Point& own) const {
    const Point detailed =
        between(narrow.normal, own, share_of_shape(narrow.variance, std::max(kRoughVariance, noise_variance_)));
    return between(wide.normal, detailed, share_of_detail(wide));
  }
  [[nodiscard]] float share_of_detail(const FittedNormal& wide) const {
    return wide.fitted ? share_of_shape(wide.variance, std::max(kSmoothVariance, noise_variance_)) : 0;
  }
  /// From 0 to 1, of the normals' variance where noise has so much.
  [[nodiscard]] static float share_of_shape(float variance, float noise) {
    return std::clamp((variance - noise) / ((kShapeRatio - 1) * noise), 0.0F, 1.0F);
  }
  [[nodiscard]] static Point between(const Point& a, const Point& b, float share) {
    const Eigen::Vector3f from(a[0], a[1], a[2]), to(b[0], b[1], b[2]);
    const Eigen::Vector3f sum = from + share * (to - from);
    const float length = sum.norm();  // never 0: both lie within 90 degrees of the normal that came
    return {sum.x() / length, sum.y() / length, sum.z() / length};
  }
  /// One sample's normal; it stays where those around are the same, whose mean has this squared length.
  void sharpen(std::uint32_t i, const Point& at, int ranges, float mean2) {
    Point normal = normal_of(i);
    if (mean2 < 1 - kBlurredVariance) {
      gather(at, support_[i] * inv_, ranges);
      Point found{};
      if (scratch_.plane.find(normal, found)) normal = found;
    }
    put(i, normal);
  }
  void gather(const Point& at, float reach, int ranges) {
    const TileSamples& s = scratch_.rows.samples();
    scratch_.plane.neighbours.clear();
    for (int r = 0; r < ranges; ++r) {
      for (std::uint32_t i = scratch_.ranges[static_cast<std::size_t>(r)].begin;
           i < scratch_.ranges[static_cast<std::size_t>(r)].end; ++i) {
        const Point p{(s.x[i] - at[0]) / reach, (s.y[i] - at[1]) / reach, (s.z[i] - at[2]) / reach};
        const float d2 = p[0] * p[0] + p[1] * p[1] + p[2] * p[2];
        if (d2 > 0 && d2 < 1) scratch_.plane.neighbours.push_back(p);
      }
    }
  }
  [[nodiscard]] Point normal_of(std::uint32_t i) const { return {s_.nx[i], s_.ny[i], s_.nz[i]}; }
  void put(std::uint32_t i, const Point& normal) {
    out_.x[i] = normal[0];
    out_.y[i] = normal[1];
    out_.z[i] = normal[2];
  }
  [[nodiscard]] float relative(std::int32_t v, std::size_t axis) const {
    return static_cast<float>(static_cast<std::int32_t>(static_cast<std::uint32_t>(v) - origin_[axis])) * inv_;
  }

  const Kernel& kernel_;
  bool only_blurred_;
  float noise_variance_;  ///< twice what the cloud's normals have
  const LocalSamples& s_;
  const std::vector<float>& support_;
  Scratch& scratch_;
  FilteredNormals& out_;
  std::array<std::uint32_t, 3> origin_{};
  float inv_ = 1;
};

}  // namespace

RefitNormals::RefitNormals(const RefitSettings& settings, const Lattice& lattice, const Kernel& kernel)
    : settings_(settings), lattice_(lattice), kernel_(kernel) {}

RefitNormals::~RefitNormals() = default;

double RefitNormals::halo() const {
  return std::ceil(static_cast<double>(settings_.widest()) * static_cast<double>(settings_.max_radius)) + 1;
}

void RefitNormals::add(std::size_t bucket, const LocalSamples& samples, const std::vector<float>& radii) {
  auto added = std::make_unique<Added>();
  LocalSamples& s = added->bucket.samples;
  s.x = samples.x;
  s.y = samples.y;
  s.z = samples.z;
  s.nx = samples.nx;
  s.ny = samples.ny;
  s.nz = samples.nz;
  const std::size_t n = s.size();
  added->bucket.support.resize(n);
  added->bucket.weight.resize(n);
  constexpr float kNoBand = 1e12F;  // steps
  added->bucket.band.assign(n, kNoBand);
  added->bucket.level.assign(n, static_cast<std::uint8_t>(settings_.level));
  const auto unit = static_cast<float>(lattice_.cell);
  SupportField::Cursor* const local = settings_.by_place ? &settings_.by_place->cursor() : nullptr;
  for (std::size_t i = 0; i < n; ++i) {
    const float q = radii[i] > 0 ? unit / radii[i] : 0.0F;
    const float support =
        local ? settings_.per_blend * local->at(s.x[i], s.y[i], s.z[i]) : static_cast<float>(settings_.support);
    added->bucket.support[i] = support * std::min(radii[i], settings_.max_radius);
    added->bucket.weight[i] = q * q * (samples.quality.empty() ? 1.0F : samples.quality[i]);
  }
  const auto [low, high] = std::minmax_element(s.z.begin(), s.z.end());
  added->low = *low;
  added->high = *high;
  added->clustered = std::make_shared<const ClusteredBucket>(cluster_samples(added->bucket, lattice_));
  added_[bucket] = std::move(added);
}

FilteredNormals RefitNormals::find(std::size_t bucket) {
  const Added& own = *added_.at(bucket);
  const LocalSamples& s = own.bucket.samples;
  ClusteredBatch around;
  for (const auto& [number, other] : added_) {
    if (static_cast<double>(other->high) + halo() >= own.low && static_cast<double>(other->low) - halo() <= own.high)
      around.push_back(other->clustered);
  }
  const std::int32_t cell = lattice_.cell_size(settings_.level);
  const std::vector<Placed> placed = place(s, cell);
  std::vector<TileSpan> tiles;
  std::vector<Block> blocks;
  for (std::size_t i = 0; i < placed.size(); ++i) {
    if (i == 0 || placed[i].block != placed[i - 1].block) {
      if (!tiles.empty()) tiles.back().end = i;
      tiles.push_back({i, placed.size()});
      blocks.push_back(placed[i].block);
    }
  }
  // Samples lie up to a cell beside the points that tiles are made for.
  const QueryLayers layers{settings_.level, floor_div(own.low, cell), floor_div(own.high, cell) + 1,
                           static_cast<float>(cell), 0};
  const TileRuns bins = bin_clusters(lattice_, layers, around, blocks);
  FilteredNormals out;
  for (auto* v : {&out.x, &out.y, &out.z}) v->resize(s.size());
  if (!settings_.only_blurred) out.residual.resize(s.size());
  tbb::enumerable_thread_specific<Scratch> scratch;
  tbb::parallel_for(std::size_t{0}, tiles.size(), [&](std::size_t t) {
    Scratch& local = scratch.local();
    local.rows.gather(lattice_, layers, blocks[t], bins.of(t));
    TileRefit(kernel_, settings_, own.bucket, local, out)
        .fit(blocks[t], cell, std::span(placed).subspan(tiles[t].begin, tiles[t].end - tiles[t].begin));
  });
  return out;
}

void RefitNormals::forget_below(std::int64_t z) {
  while (!added_.empty() && added_.begin()->second->high < z) added_.erase(added_.begin());
}

}  // namespace lamina
