// The kernel of the projection: weighted sums over samples at eight query points at once, and the fit made of them.
// One source (kernel_source.h), compiled per processor kind; all kinds give the same bits (no fused multiply-add, no
// reassociation, every query's sum in the order of the samples).
#pragma once
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace lamina {

inline constexpr int kLanes = 8;

/// Running sums at a query point x (Cuccuru et al. 2009, section 3.2), positions relative to x, lengths in cells of the
/// level. With w = weight * max(0, 1 - |p - x|^2 / R^2)^4:
enum Sum : int {
  kW = 0,  ///< sum w
  kPx,     ///< sum w p
  kPy,
  kPz,
  kNx,  ///< sum w n
  kNy,
  kNz,
  kPP,       ///< sum w p.p
  kPN,       ///< sum w p.n
  kWR,       ///< sum w R
  kNearest,  ///< min |p - x|^2 / band^2 over samples with w > 0, band = the sample's own; 0 where no band is narrower
             ///< than its sample's support
  kSeen,     ///< number of samples with w > 0
  kSums      ///< then one sum w c per attribute
};

/// Of these the last two where samples have residuals: the residual, and its square.
inline constexpr std::size_t kResidualSums = 2;

/// A sample as sums take it; lengths in cells of the level, places relative to the tile's origin.
struct TileSample {
  float x, y, z;
  float inv_support2;  ///< 1 / R^2
  float nx, ny, nz;
  float weight;     ///< q_i
  float support;    ///< R
  float inv_band2;  ///< 1 / band^2
};

/// Samples of a tile, set by put(): records, and some of their numbers once more as arrays.
struct TileSamples {
  std::vector<TileSample> all;
  std::vector<float> x, y, z, inv_support2;  ///< what tells those near a box, eight samples at once: eight longer
  bool banded = true;                        ///< some sample's band is narrower than its support
  std::vector<std::vector<float>> attributes;
  void resize(std::size_t n, std::size_t attribute_count);
  void put(std::size_t i, const TileSample& s) {
    all[i] = s;
    x[i] = s.x;
    y[i] = s.y;
    z[i] = s.z;
    inv_support2[i] = s.inv_support2;
  }
};

struct SampleRange {
  std::uint32_t begin, end;
};

struct alignas(32) Lanes {
  std::array<float, kLanes> v;
  float& operator[](int i) { return v[static_cast<std::size_t>(i)]; }
  float operator[](int i) const { return v[static_cast<std::size_t>(i)]; }
};

/// The least and the greatest of eight. Always inlined: processor kinds must not share it.
struct Extremes {
  float least, most;
};
[[gnu::always_inline]] inline Extremes extremes_of(const Lanes& l) {
  std::array<float, 4> least;  // NOLINT(cppcoreguidelines-pro-type-member-init): filled next
  std::array<float, 4> most;   // NOLINT(cppcoreguidelines-pro-type-member-init)
  for (std::size_t i = 0; i < 4; ++i) {
    least[i] = std::min(l.v[i], l.v[i + 4]);
    most[i] = std::max(l.v[i], l.v[i + 4]);
  }
  return {std::min(std::min(least[0], least[1]), std::min(least[2], least[3])),
          std::max(std::max(most[0], most[1]), std::max(most[2], most[3]))};
}

struct Queries {
  Lanes x, y, z;
};

/// Samples of one sheet, told by their normals: those with n . a >= least for both of two axes a. An axis of zero with
/// a least of zero or less takes all.
struct NormalRegion {
  Queries first, second;
  Lanes first_least, second_least;
};

/// Sums over a sheet's samples: Sum up to kSums, without kNearest and kSeen, and one more.
inline constexpr int kThickness = kSums;  ///< sum w (p.n)^2
inline constexpr int kSheetSums = kSums + 1;
/// Sums of the products of normals' components, w nx nx, nx ny, nx nz, ny ny, ny nz, nz nz; behind them sum w.
inline constexpr int kMoments = 6;

/// Where the samples spread less than this (support^2) no curvature is estimated: rounding would make it.
inline constexpr float kFlatSpread = 1e-3F;

struct FitInput {
  bool sphere = true;
  Queries offset;  ///< corner minus query point
};

/// The fit at eight corners, lengths in cells.
struct FitOutput {
  Lanes distance;                ///< signed distance of the corner
  Lanes nx, ny, nz;              ///< unit normal at the projected point; zero where there is none
  Lanes curvature;               ///< signed, 1 / cell
  Lanes offset_from_mean;        ///< |projected point - weighted average| / local support
  Lanes lean_x, lean_y, lean_z;  ///< (weighted average - projected point) / local support
};

/// The rule of extension: a corner that is not trusted takes the mean of what the tangent planes of the trusted among
/// its 26 neighbours say there, weights 1 / m^2, m the number of axes in which the neighbour differs. Signs (the
/// kernel, eight corners at once) and values (corner_value(), one corner) add the neighbours up one by one in
/// for_neighbours()'s order, so that they agree to the bit.
template <typename F>
constexpr void for_neighbours(const F& f) {
  for (int dz = -1; dz <= 1; ++dz) {
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        if (dx != 0 || dy != 0 || dz != 0) f(dx, dy, dz);
      }
    }
  }
}
[[gnu::always_inline]] constexpr float neighbour_weight(int dx, int dy, int dz) {
  constexpr std::array<float, 4> kWeights{0.0F, 1.0F, 1.0F / 4, 1.0F / 9};  // by m: a division would be slow
  return kWeights[static_cast<std::size_t>((dx != 0) + (dy != 0) + (dz != 0))];
}
/// Of one corner (float) or of eight side by side (a vector); lengths in steps. Always inlined: an instance of its own
/// would be one for all kinds of processor.
template <typename T>
struct TangentPlane {
  T distance, nx, ny, nz;
  /// Its distance at the corner whose neighbour (dx, dy, dz) this one is.
  [[nodiscard, gnu::always_inline]] T seen_from(int dx, int dy, int dz, float cell) const {
    return distance - cell * (nx * static_cast<float>(dx) + ny * static_cast<float>(dy) + nz * static_cast<float>(dz));
  }
};

/// Trusted corners of a tile and one corner around it, dense: [z + 1][y + 1][x + 1] with rows of kRow floats; zero
/// where there is none. Lengths in steps.
struct CornerField {
  static constexpr int kRow = 16;
  static constexpr int kRows = 10;
  static constexpr int kPlane = kRows * kRow;
  static constexpr int kSize = 10 * kPlane;
  std::array<float, kSize> distance{}, nx{}, ny{}, nz{}, trusted{};
  std::array<std::uint8_t, 10 * kRows> any{};  ///< [z + 1][y + 1]: whether the row has trusted corners

  void put(int x, int y, int z, const TangentPlane<float>& plane) { set(x, y, z, plane, true); }
  /// Of what was put all or nothing is taken out. Quicker than rows cleared when the first corner comes: which corner
  /// that is is as good as random.
  void take_out(int x, int y, int z) { set(x, y, z, {}, false); }

 private:
  void set(int x, int y, int z, const TangentPlane<float>& plane, bool is_trusted) {
    const int row = (z + 1) * kRows + y + 1;
    const int at = row * kRow + x + 1;
    any[row] = is_trusted ? 1 : 0;
    distance[at] = plane.distance;
    nx[at] = plane.nx;
    ny[at] = plane.ny;
    nz[at] = plane.nz;
    trusted[at] = is_trusted ? 1.0F : 0.0F;
  }
};

/// What the trusted ones among 26 neighbours say about eight corners, a bit each.
struct Extension {
  std::uint8_t outside;     ///< the mean distance of the neighbours' planes is not negative
  std::uint8_t defined;     ///< there are trusted neighbours
  std::uint8_t surrounded;  ///< and their weighted mean lies near the corner, measured along the surface
};

struct Kernel {
  const char* name;  ///< "x86-64-v3", ...
  /// Adds samples of `ranges` to `sums` (kSums + attributes lanes).
  void (*accumulate)(const TileSamples&, const SampleRange* ranges, int count, const Queries&, Lanes* sums);
  /// The same without the samples whose normals point away from a query's `facing`, a vector of any length.
  void (*accumulate_facing)(const TileSamples&, const SampleRange* ranges, int count, const Queries&,
                            const Queries& facing, Lanes* sums);
  /// Adds the samples of one sheet to its sums (kSheetSums lanes), and to the moments of its normals (kMoments + 1
  /// lanes).
  void (*accumulate_sheet)(const TileSamples&, const SampleRange* ranges, int count, const Queries&,
                           const NormalRegion&, Lanes* sums);
  void (*accumulate_moments)(const TileSamples&, const SampleRange* ranges, int count, const Queries&,
                             const NormalRegion&, Lanes* moments);
  void (*fit)(const Lanes* sums, const FitInput&, FitOutput&);
  /// Extends trusted neighbours' planes to the eight corners of row (y, z) of a tile. `cell` in steps; `surrounded2`:
  /// squared distance in cells up to which a corner is surrounded.
  Extension (*extend)(const CornerField&, int y, int z, float cell, float surrounded2);
};

/// Kernels this processor can run, best last.
std::vector<Kernel> available_kernels();
/// The best one, or the one LAMINA_KERNEL names (v2, v3, v4) for tests and measurements.
Kernel select_kernel();

// The instances, one per processor kind (kernel_v*.cpp); available_kernels() chooses among them.
namespace kernel_v2 {
Kernel kernel();
}
namespace kernel_v3 {
Kernel kernel();
}
namespace kernel_v4 {
Kernel kernel();
}

}  // namespace lamina
