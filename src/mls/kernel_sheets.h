// The kernel's sums over the samples of a sheet (mls/creases.h); included by kernel_source.h, inside its namespace. No
// include guard on purpose.

/// Calls add(sample, dx, dy, dz, d2, w) for the samples that act on the queries' box; w > 0 in the lanes in whose
/// region they are.
template <typename Add>
void for_region(const TileSamples& s, const SampleRange* ranges, int count, const Queries& query,
                const NormalRegion& region, const Add& add) {
  const Vec zero = splat(0.0F);
  const Vec one = splat(1.0F);
  Picker picker(s, ranges, count, query);
  std::array<std::uint32_t, Picker::kMost> picked;
  while (const int n = picker.next(picked.data())) {
    for (int k = 0; k < n; ++k) {
      const TileSample& p = s.all[picked[k]];
      const Vec dx = splat(p.x) - vec(query.x);
      const Vec dy = splat(p.y) - vec(query.y);
      const Vec dz = splat(p.z) - vec(query.z);
      const Vec d2 = dx * dx + dy * dy + dz * dz;
      const auto along = [&](const Queries& axis) {
        return splat(p.nx) * vec(axis.x) + splat(p.ny) * vec(axis.y) + splat(p.nz) * vec(axis.z);
      };
      Vec t = one - d2 * splat(p.inv_support2);
      t = along(region.first) >= vec(region.first_least) ? t : zero;
      t = along(region.second) >= vec(region.second_least) ? t : zero;
      const Vec phi = t > zero ? t : zero;
      const Vec phi2 = phi * phi;
      add(p, dx, dy, dz, d2, splat(p.weight) * (phi2 * phi2));
    }
  }
}

inline void accumulate_sheet(const TileSamples& s, const SampleRange* ranges, int count, const Queries& query,
                             const NormalRegion& region, Lanes* sums) {
  std::array<Vec, kSheetSums> sum;
  for (int k = 0; k < kSheetSums; ++k) sum[k] = vec(sums[k]);
  for_region(
      s, ranges, count, query, region,
      [&](const TileSample& p, const Vec& dx, const Vec& dy, const Vec& dz, const Vec& d2, const Vec& w)
          __attribute__((always_inline)) {
            const Vec nx = splat(p.nx);
            const Vec ny = splat(p.ny);
            const Vec nz = splat(p.nz);
            const Vec pn = dx * nx + dy * ny + dz * nz;
            sum[kW] += w;
            sum[kPx] += w * dx;
            sum[kPy] += w * dy;
            sum[kPz] += w * dz;
            sum[kNx] += w * nx;
            sum[kNy] += w * ny;
            sum[kNz] += w * nz;
            sum[kPP] += w * d2;
            sum[kPN] += w * pn;
            sum[kWR] += w * splat(p.support);
            sum[kThickness] += w * pn * pn;
          });
  for (int k = 0; k < kSheetSums; ++k) vec(sums[k]) = sum[k];
}

inline void accumulate_moments(const TileSamples& s, const SampleRange* ranges, int count, const Queries& query,
                               const NormalRegion& region, Lanes* moments) {
  std::array<Vec, kMoments + 1> sum;
  for (int k = 0; k <= kMoments; ++k) sum[k] = vec(moments[k]);
  for_region(
      s, ranges, count, query, region,
      [&](const TileSample& p, const Vec&, const Vec&, const Vec&, const Vec&, const Vec& w)
          __attribute__((always_inline)) {
            const Vec nx = splat(p.nx);
            const Vec ny = splat(p.ny);
            const Vec nz = splat(p.nz);
            sum[0] += w * (nx * nx);
            sum[1] += w * (nx * ny);
            sum[2] += w * (nx * nz);
            sum[3] += w * (ny * ny);
            sum[4] += w * (ny * nz);
            sum[5] += w * (nz * nz);
            sum[kMoments] += w;
          });
  for (int k = 0; k <= kMoments; ++k) vec(moments[k]) = sum[k];
}
