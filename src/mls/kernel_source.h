// Body of the projection kernel; included by kernel_v*.cpp inside a namespace of its own, once per processor kind.
// No include guard on purpose.

typedef float Vec __attribute__((vector_size(32)));  // NOLINT(modernize-use-using): attributes on typedefs

inline Vec splat(float f) {
  return Vec{f, f, f, f, f, f, f, f};
}
inline const Vec& vec(const Lanes& l) {
  return *reinterpret_cast<const Vec*>(l.v.data());
}
inline Vec& vec(Lanes& l) {
  return *reinterpret_cast<Vec*>(l.v.data());
}

typedef int IntVec __attribute__((vector_size(32)));  // NOLINT(modernize-use-using)

inline Vec load(const float* p) {
  Vec v;
  __builtin_memcpy(&v, p, sizeof(v));
  return v;
}

#include "mls/kernel_picker.h"

/// `A`: number of attributes where known at compile time, else negative. `B`: whether samples have bands narrower than
/// their supports; otherwise every contributing sample is near enough. `F`: whether samples whose normals point away
/// from `facing` are passed over.
template <int A, bool B, bool F>
void accumulate_body(const TileSamples& s, const SampleRange* ranges, int count, const Queries& query,
                     const Queries& facing, Lanes* sums) {
  const Vec qx = vec(query.x);
  const Vec qy = vec(query.y);
  const Vec qz = vec(query.z);
  Vec w_sum = vec(sums[kW]);
  Vec px = vec(sums[kPx]);
  Vec py = vec(sums[kPy]);
  Vec pz = vec(sums[kPz]);
  Vec nx = vec(sums[kNx]);
  Vec ny = vec(sums[kNy]);
  Vec nz = vec(sums[kNz]);
  Vec pp = vec(sums[kPP]);
  Vec pn = vec(sums[kPN]);
  Vec wr = vec(sums[kWR]);
  Vec nearest = vec(sums[kNearest]);
  Vec seen = vec(sums[kSeen]);
  std::array<Vec, std::max(A, 1)> own{};
  for (int a = 0; a < A; ++a) own[a] = vec(sums[kSums + a]);
  const Vec seen_before = seen;
  const Vec zero = splat(0.0F);
  const Vec one = splat(1.0F);
  const Vec far = splat(1e30F);
  Picker picker(s, ranges, count, query);
  std::array<std::uint32_t, Picker::kMost> picked;
  while (const int n = picker.next(picked.data())) {
    for (int k = 0; k < n; ++k) {
      const std::uint32_t i = picked[k];
      const TileSample& p = s.all[i];
      const Vec dx = splat(p.x) - qx;
      const Vec dy = splat(p.y) - qy;
      const Vec dz = splat(p.z) - qz;
      const Vec d2 = dx * dx + dy * dy + dz * dz;
      Vec t = one - d2 * splat(p.inv_support2);
      if constexpr (F) {
        const Vec along = splat(p.nx) * vec(facing.x) + splat(p.ny) * vec(facing.y) + splat(p.nz) * vec(facing.z);
        t = along >= zero ? t : zero;
      }
      const Vec phi = t > zero ? t : zero;
      const Vec phi2 = phi * phi;
      const Vec w = splat(p.weight) * (phi2 * phi2);
      const Vec snx = splat(p.nx);
      const Vec sny = splat(p.ny);
      const Vec snz = splat(p.nz);
      w_sum += w;
      px += w * dx;
      py += w * dy;
      pz += w * dz;
      nx += w * snx;
      ny += w * sny;
      nz += w * snz;
      pp += w * d2;
      pn += w * (dx * snx + dy * sny + dz * snz);
      wr += w * splat(p.support);
      seen += t > zero ? one : zero;
      if constexpr (B) {
        // Only samples that contribute: which others are looked at is a matter of tiles and rows.
        const Vec near = t > zero ? d2 * splat(p.inv_band2) : far;
        nearest = near < nearest ? near : nearest;
      }
      if constexpr (A >= 0) {
        for (int a = 0; a < A; ++a) own[a] += w * splat(s.attributes[a][i]);
      } else {
        for (std::size_t a = 0; a < s.attributes.size(); ++a) vec(sums[kSums + a]) += w * splat(s.attributes[a][i]);
      }
    }
  }
  vec(sums[kW]) = w_sum;
  vec(sums[kPx]) = px;
  vec(sums[kPy]) = py;
  vec(sums[kPz]) = pz;
  vec(sums[kNx]) = nx;
  vec(sums[kNy]) = ny;
  vec(sums[kNz]) = nz;
  vec(sums[kPP]) = pp;
  vec(sums[kPN]) = pn;
  vec(sums[kWR]) = wr;
  vec(sums[kNearest]) = B ? nearest : (seen > seen_before ? zero : nearest);
  vec(sums[kSeen]) = seen;
  for (int a = 0; a < A; ++a) vec(sums[kSums + a]) = own[a];
}

template <bool B, bool F>
void accumulate_some(const TileSamples& s, const SampleRange* ranges, int count, const Queries& query,
                     const Queries& facing, Lanes* sums) {
  switch (s.attributes.size()) {
    case 0:
      return accumulate_body<0, B, F>(s, ranges, count, query, facing, sums);
    case 1:
      return accumulate_body<1, B, F>(s, ranges, count, query, facing, sums);
    case 2:
      return accumulate_body<2, B, F>(s, ranges, count, query, facing, sums);
    case 3:
      return accumulate_body<3, B, F>(s, ranges, count, query, facing, sums);
    case 5:
      return accumulate_body<5, B, F>(s, ranges, count, query, facing, sums);
    default:
      return accumulate_body<-1, B, F>(s, ranges, count, query, facing, sums);
  }
}

inline void accumulate(const TileSamples& s, const SampleRange* ranges, int count, const Queries& query, Lanes* sums) {
  return s.banded ? accumulate_some<true, false>(s, ranges, count, query, query, sums)
                  : accumulate_some<false, false>(s, ranges, count, query, query, sums);
}

inline void accumulate_facing(const TileSamples& s, const SampleRange* ranges, int count, const Queries& query,
                              const Queries& facing, Lanes* sums) {
  return s.banded ? accumulate_some<true, true>(s, ranges, count, query, facing, sums)
                  : accumulate_some<false, true>(s, ranges, count, query, facing, sums);
}

#include "mls/kernel_sheets.h"

/// Exactly rounded, so the same on all processors.
inline Vec root(const Vec& v) {
  Vec out;
  for (int l = 0; l < kLanes; ++l) out[l] = std::sqrt(v[l]);
  return out;
}

/// Plane or algebraic sphere through the weighted samples (Guennebaud & Gross 2007, the closed form of the
/// normal-constrained fit), evaluated at the corner.
inline void fit(const Lanes* sums, const FitInput& in, FitOutput& out) {
  const Vec zero = splat(0.0F);
  const Vec one = splat(1.0F);
  const Vec two = splat(2.0F);
  const Vec four = splat(4.0F);
  const Vec tiny = splat(1e-20F);
  const Vec w = vec(sums[kW]);
  const Vec inv = w > zero ? one / (w > zero ? w : one) : zero;
  const Vec ax = vec(sums[kPx]) * inv;
  const Vec ay = vec(sums[kPy]) * inv;
  const Vec az = vec(sums[kPz]) * inv;
  const Vec mx = vec(sums[kNx]) * inv;
  const Vec my = vec(sums[kNy]) * inv;
  const Vec mz = vec(sums[kNz]) * inv;
  const Vec support = vec(sums[kWR]) * inv;
  const Vec pp = vec(sums[kPP]) * inv;
  const Vec spread = pp - (ax * ax + ay * ay + az * az);
  const Vec co = vec(sums[kPN]) * inv - (mx * ax + my * ay + mz * az);
  const Vec flat = in.sphere ? splat(kFlatSpread) * support * support : splat(1e30F);
  const Vec u4 = spread > flat ? co / (spread > flat ? two * spread : one) : zero;
  const Vec ux = mx - two * u4 * ax;
  const Vec uy = my - two * u4 * ay;
  const Vec uz = mz - two * u4 * az;
  const Vec u0 = -(ux * ax + uy * ay + uz * az + u4 * pp);
  const Vec yx = vec(in.offset.x);
  const Vec yy = vec(in.offset.y);
  const Vec yz = vec(in.offset.z);
  const Vec f = u0 + (ux * yx + uy * yy + uz * yz) + u4 * (yx * yx + yy * yy + yz * yz);
  const Vec gx = ux + two * u4 * yx;
  const Vec gy = uy + two * u4 * yy;
  const Vec gz = uz + two * u4 * yz;
  const Vec g2 = gx * gx + gy * gy + gz * gz;
  const Vec g = root(g2 > tiny ? g2 : tiny);
  const Vec disc = g2 - four * u4 * f;
  const Vec deep = g + root(disc >= zero ? disc : zero);
  const Vec d = (disc >= zero ? two * f : f) / (disc >= zero ? deep : g);
  const Vec inv_g = one / g;
  const Vec nx = gx * inv_g;
  const Vec ny = gy * inv_g;
  const Vec nz = gz * inv_g;
  const Vec u2 = ux * ux + uy * uy + uz * uz - four * u0 * u4;
  const Vec scale = root(u2 > tiny ? u2 : tiny);
  const Vec rx = yx - d * nx - ax;
  const Vec ry = yy - d * ny - ay;
  const Vec rz = yz - d * nz - az;
  const Vec inv_support = one / (w > zero ? support : one);
  const Vec offset = root(rx * rx + ry * ry + rz * rz) / (w > zero ? support : one);
  const auto ok = (w > zero) & (g2 > tiny);
  vec(out.distance) = ok ? d : zero;
  vec(out.nx) = ok ? nx : zero;
  vec(out.ny) = ok ? ny : zero;
  vec(out.nz) = ok ? nz : zero;
  vec(out.curvature) = ok ? two * u4 / scale : zero;
  vec(out.offset_from_mean) = ok ? offset : zero;
  vec(out.lean_x) = ok ? -rx * inv_support : zero;
  vec(out.lean_y) = ok ? -ry * inv_support : zero;
  vec(out.lean_z) = ok ? -rz * inv_support : zero;
}

/// A bit for every lane where a comparison holds.
inline std::uint8_t lanes(const IntVec& holds) {
  const IntVec bits = holds & IntVec{1, 2, 4, 8, 16, 32, 64, 128};
  int out = 0;
  for (int l = 0; l < kLanes; ++l) out |= bits[l];
  return static_cast<std::uint8_t>(out);
}

/// A channel of three rows' corners side by side: the middle ones, and sum and difference of the outer ones.
struct Triple {
  Vec middle, sum, difference;
};

inline Triple triple(const float* p) {
  const Vec low = load(p - 1);
  const Vec high = load(p + 1);
  return {load(p), low + high, high - low};
}

/// What the trusted neighbours of eight corners add up to, row by row.
struct Neighbours {
  Vec s{};               ///< the sign's sum as for_neighbours() has it
  Vec w{};               ///< weights
  Vec nx{}, ny{}, nz{};  ///< normals
  Vec ox{}, oy{}, oz{};  ///< where they lie

  /// Those at (-1 to 1, kY, kZ), in the row of the field that has its middle at `at`. Where nothing is trusted the
  /// field is zero and adds nothing. Products with 0 and 1 are left out: at most a zero has another sign.
  template <int kY, int kZ>
  [[gnu::always_inline]] void add_row(const CornerField& f, int at, float cell) {
    constexpr int kAcross = (kY != 0) + (kZ != 0);
    add_plane<-1, kY, kZ>(f, at, cell);
    if constexpr (kAcross != 0) add_plane<0, kY, kZ>(f, at, cell);
    add_plane<1, kY, kZ>(f, at, cell);
    const Triple t = triple(&f.trusted[at]);
    const Vec row_t = weighted<kAcross>(t);
    w += row_t;
    nx += weighted<kAcross>(triple(&f.nx[at]));
    ny += weighted<kAcross>(triple(&f.ny[at]));
    nz += weighted<kAcross>(triple(&f.nz[at]));
    ox += neighbour_weight(1, kY, kZ) * t.difference;
    if constexpr (kY != 0) oy += kY < 0 ? -row_t : row_t;
    if constexpr (kZ != 0) oz += kZ < 0 ? -row_t : row_t;
  }

 private:
  template <int kX, int kY, int kZ>
  [[gnu::always_inline]] void add_plane(const CornerField& f, int at, float cell) {
    Vec rise{};  // its change along the offset, cells
    const auto step = [&]<int kSign, bool kFirst>(const float* normal) {
      if constexpr (kSign == 0) return;
      const Vec along = kSign < 0 ? -load(normal) : load(normal);
      rise = kFirst ? along : rise + along;
    };
    step.template operator()<kX, true>(&f.nx[at + kX]);
    step.template operator()<kY, kX == 0>(&f.ny[at + kX]);
    step.template operator()<kZ, kX == 0 && kY == 0>(&f.nz[at + kX]);
    const Vec seen = load(&f.distance[at + kX]) - cell * rise;
    s += (kX != 0) + (kY != 0) + (kZ != 0) == 1 ? seen : neighbour_weight(kX, kY, kZ) * seen;
  }
  /// The middle one and the outer ones of a row, so many axes away from the corner.
  template <int kAcross>
  [[gnu::always_inline]] static Vec weighted(const Triple& of) {
    const Vec outer = kAcross == 0 ? of.sum : neighbour_weight(1, kAcross > 0, kAcross > 1) * of.sum;
    if constexpr (kAcross == 0) return outer;
    return (kAcross == 1 ? of.middle : neighbour_weight(0, 1, 1) * of.middle) + outer;
  }
};

inline Extension extend(const CornerField& f, int y, int z, float cell, float surrounded2) {
  const Vec zero = splat(0.0F);
  Neighbours sums;
  const auto row = [&]<int kY, int kZ> {
    const int at = (z + 1 + kZ) * CornerField::kRows + y + 1 + kY;
    if (f.any[at] != 0) sums.add_row<kY, kZ>(f, at * CornerField::kRow + 1, cell);
  };
  row.template operator()<-1, -1>();
  row.template operator()<0, -1>();
  row.template operator()<1, -1>();
  row.template operator()<-1, 0>();
  row.template operator()<0, 0>();
  row.template operator()<1, 0>();
  row.template operator()<-1, 1>();
  row.template operator()<0, 1>();
  row.template operator()<1, 1>();
  const auto& [s, w, nx, ny, nz, ox, oy, oz] = sums;
  const Vec any = w > zero ? w : splat(1.0F);
  const Vec n2 = nx * nx + ny * ny + nz * nz;
  const Vec along = ox * nx + oy * ny + oz * nz;
  const Vec n2_or_one = n2 > zero ? n2 : splat(1.0F);
  const Vec aside = (ox * ox + oy * oy + oz * oz - along * along / n2_or_one) / (any * any);
  return {lanes(s >= zero), lanes(w > zero), lanes((w > zero) & (aside <= splat(surrounded2)))};
}
