#include "normals/planes.h"

#include <emmintrin.h>

#include <algorithm>
#include <bit>

namespace lamina::normals {
namespace {

typedef double TwoDoubles __attribute__((vector_size(16)));      // NOLINT(modernize-use-using): attributes on typedefs
typedef std::int64_t TwoLongs __attribute__((vector_size(16)));  // NOLINT(modernize-use-using): attributes on typedefs
using TwoVectors = std::array<TwoDoubles, 3>;

TwoDoubles square_root(const TwoDoubles& v) {
  return std::bit_cast<TwoDoubles>(_mm_sqrt_pd(std::bit_cast<__m128d>(v)));
}
bool any_of(const TwoLongs& mask) {
  return _mm_movemask_pd(std::bit_cast<__m128d>(mask)) != 0;
}
TwoDoubles at_least_zero(const TwoDoubles& v) {
  return v > 0 ? v : TwoDoubles{};
}
TwoDoubles dot(const TwoVectors& a, const TwoVectors& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
TwoVectors cross(const TwoVectors& a, const TwoVectors& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

/// The least root of l^3 - t l^2 + s l - d with t = 1, all of whose roots are real and not negative: Newton's steps
/// from 0 never pass it.
TwoDoubles least_root(const TwoDoubles& s, const TwoDoubles& d) {
  TwoDoubles l{};
  for (int i = 0; i < 64; ++i) {
    const TwoDoubles value = ((l - 1) * l + s) * l - d;
    const TwoDoubles slope = (3 * l - 2) * l + s;
    const TwoDoubles next = l - value / slope;
    const TwoLongs nearer = (value < 0) & (slope > 0) & (next > l);
    if (!any_of(nearer)) break;
    l = nearer ? next : l;
  }
  return l;
}

/// Sums of whole numbers up to this are exact, in whatever order.
constexpr double kExact = 9007199254740992;  // 2^53

/// Of four others at a time, all of them.
Moments moments_by_four(const SampleTree& tree, std::uint32_t place, std::span<const Neighbour> others) {
  TwoVectors sum{};
  std::array<TwoDoubles, 6> products{};
  for (std::size_t n = 0; n < others.size(); n += 4) {
    const std::array<std::uint32_t, 4> places{others[n].sample, others[n + 1].sample, others[n + 2].sample,
                                              others[n + 3].sample};
    const std::array<FourFloats, 3> d = tree.offsets(place, places.data());
    const auto add = [&](const TwoDoubles& x, const TwoDoubles& y, const TwoDoubles& z) {
      sum[0] += x;
      sum[1] += y;
      sum[2] += z;
      products[0] += x * x;
      products[1] += x * y;
      products[2] += x * z;
      products[3] += y * y;
      products[4] += y * z;
      products[5] += z * z;
    };
    const auto low = [&](std::size_t a) { return TwoDoubles{d[a][0], d[a][1]}; };
    const auto high = [&](std::size_t a) { return TwoDoubles{d[a][2], d[a][3]}; };
    add(low(0), low(1), low(2));
    add(high(0), high(1), high(2));
  }
  const auto all = [](const TwoDoubles& v) { return v[0] + v[1]; };
  Moments m;
  m.count = static_cast<double>(others.size() + 1);
  std::transform(sum.begin(), sum.end(), m.sum.begin(), all);
  std::transform(products.begin(), products.end(), m.products.begin(), all);
  return m;
}

}  // namespace

Moments moments_around(const SampleTree& tree, std::uint32_t place, std::span<const Neighbour> others) {
  // Offsets are whole numbers of steps, and no product exceeds the squared distance; half of it is for its rounding.
  const bool exact =
      !others.empty() && static_cast<double>(others.size() + 1) * double{others.back().squared} < kExact / 2;
  if (exact && others.size() % 4 == 0) return moments_by_four(tree, place, others);
  Moments m;
  m.count = 1;  // the sample itself
  for (const Neighbour& other : others) m.add(tree.offset(place, other.sample));
  return m;
}

std::array<Plane, 2> fit_planes(const std::array<Moments, 2>& m) {
  const auto both = [&](const auto& of) { return TwoDoubles{of(m[0]), of(m[1])}; };
  const TwoDoubles count = both([](const Moments& one) { return one.count; });
  const TwoDoubles n = 1 / count;
  TwoVectors mean;
  for (std::size_t a = 0; a < 3; ++a) mean[a] = both([a](const Moments& one) { return one.sum[a]; }) * n;
  const auto variance = [&](std::size_t product, std::size_t a, std::size_t b) {
    const TwoDoubles sum = both([product](const Moments& one) { return one.products[product]; });
    return sum * n - mean[a] * mean[b];
  };
  TwoDoubles xx = variance(0, 0, 0);
  TwoDoubles xy = variance(1, 0, 1);
  TwoDoubles xz = variance(2, 0, 2);
  TwoDoubles yy = variance(3, 1, 1);
  TwoDoubles yz = variance(4, 1, 2);
  TwoDoubles zz = variance(5, 2, 2);
  const TwoDoubles trace = xx + yy + zz;
  // Of trace one: what follows is a matter of ratios.
  const TwoDoubles scale = 1 / trace;
  for (TwoDoubles* v : {&xx, &xy, &xz, &yy, &yz, &zz}) *v *= scale;
  const TwoDoubles s = xx * yy - xy * xy + xx * zz - xz * xz + yy * zz - yz * yz;
  const TwoDoubles d = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz);
  const TwoDoubles root = least_root(s, d);
  const TwoDoubles third = TwoDoubles{} + 1.0 / 3;
  const TwoDoubles least = root > third ? third : root;
  const TwoDoubles sum = 1 - least;  // of the other two
  const TwoDoubles product = at_least_zero(s - least * sum);
  const TwoDoubles half = 0.5 * sum;
  const TwoDoubles most = half + square_root(at_least_zero(half * half - product));

  const TwoVectors r0{xx - least, xy, xz};
  const TwoVectors r1{xy, yy - least, yz};
  const TwoVectors r2{xz, yz, zz - least};
  TwoVectors best = cross(r0, r1);
  TwoDoubles squared = dot(best, best);
  for (const TwoVectors& c : {cross(r0, r2), cross(r1, r2)}) {
    const TwoDoubles longer = dot(c, c);
    const TwoLongs is_longer = longer > squared;
    for (std::size_t a = 0; a < 3; ++a) best[a] = is_longer ? c[a] : best[a];
    squared = is_longer ? longer : squared;
  }
  const TwoDoubles inverse = 1 / square_root(squared);

  std::array<Plane, 2> planes;
  for (std::size_t i = 0; i < 2; ++i) {
    if (!(count[i] >= 3 && trace[i] > 0)) continue;
    planes[i].least = least[i] * trace[i];
    planes[i].middle = product[i] / most[i] * trace[i];
    planes[i].most = most[i] * trace[i];
    // The rows span a line where the two smaller variances are equal: no plane is the best.
    constexpr double kNone = 1e-18;
    if (!(squared[i] > kNone)) continue;
    for (std::size_t a = 0; a < 3; ++a) planes[i].normal[a] = static_cast<float>(best[a][i] * inverse[i]);
  }
  return planes;
}

inline void FourMoments::add(const std::array<FourFloats, 3>& d, const FourFloats& weight) {
  const FourFloats x = weight * d[0];
  const FourFloats y = weight * d[1];
  const FourFloats z = weight * d[2];
  count += weight;
  sum[0] += x;
  sum[1] += y;
  sum[2] += z;
  products[0] += x * d[0];
  products[1] += x * d[1];
  products[2] += x * d[2];
  products[3] += y * d[1];
  products[4] += y * d[2];
  products[5] += z * d[2];
}

Moments FourMoments::total() const {
  const auto all = [](const FourFloats& v) { return double{sum_of(v)}; };
  Moments m;
  m.count = all(count);
  std::transform(sum.begin(), sum.end(), m.sum.begin(), all);
  std::transform(products.begin(), products.end(), m.products.begin(), all);
  return m;
}

Moments BallMoments::grow_to(float squared) {
  tree_.fours_within({place_, squared_, squared}, [&](const SampleTree::FourSamples& four) {
    constexpr FourFloats kOne{1, 1, 1, 1};
    sums_.add(four.offset, where((four.squared > squared_) & (four.squared <= squared), kOne));
  });
  squared_ = squared;
  return sums_.total();
}

Plane plane_within(const SampleTree& tree, std::uint32_t place, float squared) {
  const float inverse = 1 / squared;
  FourMoments sums;
  tree.fours_within({place, -1, squared}, [&](const SampleTree::FourSamples& four) {
    sums.add(four.offset, where(four.squared <= squared, 1 - four.squared * inverse));
  });
  return fit_plane(sums.total());
}

}  // namespace lamina::normals
