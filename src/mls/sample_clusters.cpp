#include "mls/sample_clusters.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "samples/block_order.h"

namespace lamina {
namespace {

constexpr std::int32_t kMost = std::numeric_limits<std::int32_t>::max();
constexpr std::int32_t kLeast = std::numeric_limits<std::int32_t>::min();

/// Edge of a cluster's cube in cells. Smaller ones fit tiles more closely but are more.
constexpr int kEdge = 4;

/// More cubes than this in a level are joined to larger ones, so that their numbers stay small.
constexpr double kMostCubes = 1e12;

struct Keyed {
  std::uint64_t key;  ///< number of the cube
  std::uint32_t sample;
};

/// Cubes of a level that the bucket covers, numbered z, y, x.
struct Cubes {
  std::array<std::int32_t, 3> origin{};
  std::array<std::uint64_t, 3> count{};
  std::int32_t edge = 1;
  std::uint64_t first = 0;  ///< number of the first

  [[nodiscard]] std::uint64_t number(std::int32_t x, std::int32_t y, std::int32_t z) const {
    const auto at = [&](std::int32_t v, int axis) {
      return static_cast<std::uint64_t>((static_cast<std::uint32_t>(v) - static_cast<std::uint32_t>(origin[axis])) /
                                        static_cast<std::uint32_t>(edge));
    };
    return first + (at(z, 2) * count[1] + at(y, 1)) * count[0] + at(x, 0);
  }
};

std::vector<Cubes> cubes_of(const LocalSamples& s, const Lattice& lattice) {
  const auto [x0, x1] = std::minmax_element(s.x.begin(), s.x.end());
  const auto [y0, y1] = std::minmax_element(s.y.begin(), s.y.end());
  const auto [z0, z1] = std::minmax_element(s.z.begin(), s.z.end());
  const std::array<std::int32_t, 3> low{*x0, *y0, *z0};
  const std::array<std::int32_t, 3> high{*x1, *y1, *z1};
  std::vector<Cubes> cubes(static_cast<std::size_t>(lattice.levels));
  std::uint64_t first = 0;
  for (int level = 0; level < lattice.levels; ++level) {
    Cubes& c = cubes[static_cast<std::size_t>(level)];
    // Cubes of huge cells would pass the range of an int; one holds everything then.
    c.edge = std::min(lattice.cell_size(level), kMost / kEdge) * kEdge;
    c.first = first;
    const auto set = [&](std::int32_t edge) {
      c.edge = edge;
      double all = 1;
      for (int axis = 0; axis < 3; ++axis) {
        // Aligned with the lattice, so that a cube never straddles more tiles than it must.
        const std::int64_t origin = std::int64_t{floor_div(low[axis], edge)} * edge;
        c.origin[axis] = static_cast<std::int32_t>(std::max<std::int64_t>(origin, kLeast));
        c.count[axis] = static_cast<std::uint64_t>((std::int64_t{high[axis]} - c.origin[axis]) / edge + 1);
        all *= static_cast<double>(c.count[axis]);
      }
      return all;
    };
    while (set(c.edge) > kMostCubes && c.edge <= kMost / 2) c.edge *= 2;
    first += c.count[0] * c.count[1] * c.count[2];
  }
  return cubes;
}

std::vector<Keyed> in_order(const ActiveBucket& bucket, const Lattice& lattice) {
  const LocalSamples& s = bucket.samples;
  std::vector<Keyed> keyed;
  if (s.size() == 0) return keyed;
  keyed.reserve(s.size());
  const std::vector<Cubes> cubes = cubes_of(s, lattice);
  for (std::size_t i = 0; i < s.size(); ++i) {
    if (bucket.support[i] <= 0) continue;
    keyed.push_back({cubes[bucket.level[i]].number(s.x[i], s.y[i], s.z[i]), static_cast<std::uint32_t>(i)});
  }
  const Cubes& last = cubes.back();
  std::vector<Keyed> scratch;
  digit_sort(keyed, scratch, last.first + last.count[0] * last.count[1] * last.count[2],
             [](const Keyed& k) { return k.key; });
  return keyed;
}

template <typename T>
std::vector<T> pick(const std::vector<T>& from, const std::vector<Keyed>& order) {
  std::vector<T> out(order.size());
  for (std::size_t k = 0; k < order.size(); ++k) out[k] = from[order[k].sample];
  return out;
}

std::int32_t bounded(double steps) {
  return static_cast<std::int32_t>(std::clamp(steps, double{kLeast}, double{kMost}));
}

/// Widens the cluster's box by a sample's support.
void include(const ClusteredBucket& b, std::size_t i, SampleCluster& c) {
  const double radius = static_cast<double>(b.support[i]);
  const std::array<std::int32_t, 3> p{b.x[i], b.y[i], b.z[i]};
  for (int axis = 0; axis < 3; ++axis) {
    c.low[axis] = std::min(c.low[axis], bounded(std::floor(p[axis] - radius)));
    c.high[axis] = std::max(c.high[axis], bounded(std::ceil(p[axis] + radius)));
  }
}

}  // namespace

ClusteredBucket cluster_samples(const ActiveBucket& bucket, const Lattice& lattice) {
  const std::vector<Keyed> order = in_order(bucket, lattice);
  const LocalSamples& s = bucket.samples;
  ClusteredBucket out;
  out.x = pick(s.x, order);
  out.y = pick(s.y, order);
  out.z = pick(s.z, order);
  out.nx = pick(s.nx, order);
  out.ny = pick(s.ny, order);
  out.nz = pick(s.nz, order);
  out.support = pick(bucket.support, order);
  out.weight = pick(bucket.weight, order);
  out.cell.resize(order.size());
  for (const std::vector<float>& a : s.attributes) out.attributes.push_back(pick(a, order));
  for (std::size_t k = 0; k < order.size(); ++k) {
    if (k == 0 || order[k].key != order[k - 1].key) {
      if (k > 0) out.clusters.back().end = static_cast<std::uint32_t>(k);
      out.clusters.push_back({static_cast<std::uint32_t>(k), 0, {kMost, kMost, kMost}, {kLeast, kLeast, kLeast}});
    }
    out.cell[k] = static_cast<float>(lattice.cell_size(bucket.level[order[k].sample]));
    include(out, k, out.clusters.back());
  }
  if (!order.empty()) out.clusters.back().end = static_cast<std::uint32_t>(order.size());
  return out;
}

}  // namespace lamina
