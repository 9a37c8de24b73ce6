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

/// Attribute count known at compile time where A >= 0.
template <int A>
void accumulate_body(const TileSamples& s, const SampleRange* ranges, int count, const Queries& query, Lanes* sums) {
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
  const Vec zero = splat(0.0F);
  const Vec one = splat(1.0F);
  const Vec far = splat(1e30F);
  const int attributes = A >= 0 ? A : static_cast<int>(s.attributes.size());
  for (int r = 0; r < count; ++r) {
    for (std::uint32_t i = ranges[r].begin; i < ranges[r].end; ++i) {
      const Vec dx = splat(s.x[i]) - qx;
      const Vec dy = splat(s.y[i]) - qy;
      const Vec dz = splat(s.z[i]) - qz;
      const Vec d2 = dx * dx + dy * dy + dz * dz;
      const Vec t = one - d2 * splat(s.inv_support2[i]);
      const Vec phi = t > zero ? t : zero;
      const Vec phi2 = phi * phi;
      const Vec w = splat(s.weight[i]) * (phi2 * phi2);
      const Vec snx = splat(s.nx[i]);
      const Vec sny = splat(s.ny[i]);
      const Vec snz = splat(s.nz[i]);
      w_sum += w;
      px += w * dx;
      py += w * dy;
      pz += w * dz;
      nx += w * snx;
      ny += w * sny;
      nz += w * snz;
      pp += w * d2;
      pn += w * (dx * snx + dy * sny + dz * snz);
      wr += w * splat(s.support[i]);
      // Only samples that contribute: which others are looked at is a matter of tiles and rows.
      const Vec near = t > zero ? d2 * splat(s.inv_band2[i]) : far;
      nearest = near < nearest ? near : nearest;
      seen += t > zero ? one : zero;
      for (int a = 0; a < attributes; ++a) vec(sums[kSums + a]) += w * splat(s.attributes[a][i]);
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
  vec(sums[kNearest]) = nearest;
  vec(sums[kSeen]) = seen;
}

inline void accumulate(const TileSamples& s, const SampleRange* ranges, int count, const Queries& query, Lanes* sums) {
  switch (s.attributes.size()) {
    case 0:
      return accumulate_body<0>(s, ranges, count, query, sums);
    case 3:
      return accumulate_body<3>(s, ranges, count, query, sums);
    default:
      return accumulate_body<-1>(s, ranges, count, query, sums);
  }
}

/// Plane or algebraic sphere through the weighted samples (Guennebaud & Gross 2007, the closed form of the
/// normal-constrained fit), evaluated at the corner.
inline void fit(const Lanes* sums, const FitInput& in, FitOutput& out) {
  constexpr float kTiny = 1e-20F;
  constexpr float kFlat = 1e-3F;  // spread of the samples below which no curvature is estimated, in support^2
  for (int l = 0; l < kLanes; ++l) {
    const float w = sums[kW][l];
    const float inv = w > 0 ? 1.0F / w : 0.0F;
    const float ax = sums[kPx][l] * inv;
    const float ay = sums[kPy][l] * inv;
    const float az = sums[kPz][l] * inv;
    const float mx = sums[kNx][l] * inv;
    const float my = sums[kNy][l] * inv;
    const float mz = sums[kNz][l] * inv;
    const float support = sums[kWR][l] * inv;
    const float pp = sums[kPP][l] * inv;
    const float spread = pp - (ax * ax + ay * ay + az * az);
    const float co = sums[kPN][l] * inv - (mx * ax + my * ay + mz * az);
    const bool curved = in.sphere && spread > kFlat * support * support;
    const float u4 = curved ? co / (2.0F * spread) : 0.0F;
    const float ux = mx - 2.0F * u4 * ax;
    const float uy = my - 2.0F * u4 * ay;
    const float uz = mz - 2.0F * u4 * az;
    const float u0 = -(ux * ax + uy * ay + uz * az + u4 * pp);
    const float yx = in.offset.x[l];
    const float yy = in.offset.y[l];
    const float yz = in.offset.z[l];
    const float f = u0 + (ux * yx + uy * yy + uz * yz) + u4 * (yx * yx + yy * yy + yz * yz);
    const float gx = ux + 2.0F * u4 * yx;
    const float gy = uy + 2.0F * u4 * yy;
    const float gz = uz + 2.0F * u4 * yz;
    const float g2 = gx * gx + gy * gy + gz * gz;
    const float g = std::sqrt(g2 > kTiny ? g2 : kTiny);
    const float disc = g2 - 4.0F * u4 * f;
    const float d = disc >= 0 ? 2.0F * f / (g + std::sqrt(disc >= 0 ? disc : 0.0F)) : f / g;
    const float inv_g = 1.0F / g;
    const float nx = gx * inv_g;
    const float ny = gy * inv_g;
    const float nz = gz * inv_g;
    const float u2 = ux * ux + uy * uy + uz * uz - 4.0F * u0 * u4;
    const float scale = std::sqrt(u2 > kTiny ? u2 : kTiny);
    const float rx = yx - d * nx - ax;
    const float ry = yy - d * ny - ay;
    const float rz = yz - d * nz - az;
    const bool ok = w > 0 && g2 > kTiny;
    out.distance[l] = ok ? d : 0.0F;
    out.nx[l] = ok ? nx : 0.0F;
    out.ny[l] = ok ? ny : 0.0F;
    out.nz[l] = ok ? nz : 0.0F;
    out.curvature[l] = ok ? 2.0F * u4 / scale : 0.0F;
    out.reach[l] = ok ? std::sqrt(rx * rx + ry * ry + rz * rz) / support : 0.0F;
  }
}

inline Vec load(const float* p) {
  Vec v;
  __builtin_memcpy(&v, p, sizeof(v));
  return v;
}

inline void extend(const CornerField& f, int y, int z, float cell, Extension& out) {
  const Vec zero = splat(0.0F);
  Vec s = zero;
  Vec w = zero;
  Vec nx = zero;
  Vec ny = zero;
  Vec nz = zero;
  Vec ox = zero;
  Vec oy = zero;
  Vec oz = zero;
  for (int dz = -1; dz <= 1; ++dz) {
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        const int m = (dx != 0) + (dy != 0) + (dz != 0);
        if (m == 0) continue;
        const int at = (z + 1 + dz) * CornerField::kPlane + (y + 1 + dy) * CornerField::kRow + 1 + dx;
        const Vec ax = load(&f.nx[at]);
        const Vec ay = load(&f.ny[at]);
        const Vec az = load(&f.nz[at]);
        // Vector from the neighbour to the corner; the neighbour's plane there.
        const Vec plane = load(&f.distance[at]) - cell * (ax * static_cast<float>(dx) + ay * static_cast<float>(dy) +
                                                          az * static_cast<float>(dz));
        const Vec k = load(&f.trusted[at]) * splat(1.0F / static_cast<float>(m * m));
        s += k * plane;
        w += k;
        nx += k * ax;
        ny += k * ay;
        nz += k * az;
        ox += k * static_cast<float>(dx);
        oy += k * static_cast<float>(dy);
        oz += k * static_cast<float>(dz);
      }
    }
  }
  const Vec any = w > zero ? w : splat(1.0F);
  const Vec n2 = nx * nx + ny * ny + nz * nz;
  const Vec along = ox * nx + oy * ny + oz * nz;
  const Vec n2_or_one = n2 > zero ? n2 : splat(1.0F);
  vec(out.distance) = s;
  vec(out.weight) = w;
  vec(out.aside) = (ox * ox + oy * oy + oz * oz - along * along / n2_or_one) / (any * any);
}
