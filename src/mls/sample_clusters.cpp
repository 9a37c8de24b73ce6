#include "mls/sample_clusters.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "base/vectors.h"
#include "mls/kernel.h"

namespace lamina {
namespace {

constexpr std::int32_t kMost = std::numeric_limits<std::int32_t>::max();
constexpr std::int32_t kLeast = std::numeric_limits<std::int32_t>::min();

/// Edge of a cluster's cube in cells. Smaller ones fit tiles more closely but are more.
constexpr int kClusterCells = 4;

/// More cubes than this in a level are joined to larger ones, so that their numbers stay small.
constexpr double kMostCubes = 1e12;

using Keyed = ClusterScratch::Keyed;

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
  const auto [x0, x1] = least_and_greatest(s.x);
  const auto [y0, y1] = least_and_greatest(s.y);
  const auto [z0, z1] = least_and_greatest(s.z);
  const std::array<std::int32_t, 3> low{x0, y0, z0};
  const std::array<std::int32_t, 3> high{x1, y1, z1};
  std::vector<Cubes> cubes(static_cast<std::size_t>(lattice.levels));
  std::uint64_t first = 0;
  for (int level = 0; level < lattice.levels; ++level) {
    Cubes& c = cubes[static_cast<std::size_t>(level)];
    // Cubes of huge cells would pass the range of an int; one holds everything then.
    c.edge = std::min(lattice.cell_size(level), kMost / kClusterCells) * kClusterCells;
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

constexpr std::uint64_t kNowhere = std::numeric_limits<std::uint64_t>::max();  ///< the cube of samples left out

/// Calls body(k) for all of n samples, by all threads that have nothing to do.
template <typename Body>
void for_samples(std::size_t n, const Body& body) {
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, n, kSampleGrain), [&](const auto& range) {
    for (std::size_t k = range.begin(); k < range.end(); ++k) body(k);
  });
}

/// The samples that count, by cube.
const std::vector<Keyed>& in_order(const ActiveBucket& bucket, const Lattice& lattice, ClusterScratch& scratch) {
  const LocalSamples& s = bucket.samples;
  std::vector<Keyed>& keyed = scratch.keyed;
  resize_anew(keyed, s.size());
  if (s.size() == 0) return keyed;
  const std::vector<Cubes> cubes = cubes_of(s, lattice);
  for_samples(s.size(), [&](std::size_t i) {
    const bool counts = bucket.support[i] > 0;
    keyed[i] = {counts ? cubes[bucket.level[i]].number(s.x[i], s.y[i], s.z[i]) : kNowhere,
                static_cast<std::uint32_t>(i)};
  });
  std::erase_if(keyed, [](const Keyed& k) { return k.key == kNowhere; });
  const Cubes& last = cubes.back();
  digit_sort(keyed, scratch.other, last.first + last.count[0] * last.count[1] * last.count[2],
             [](const Keyed& k) { return k.key; });
  return keyed;
}

void pick(const std::vector<float>& from, const std::vector<Keyed>& order, std::vector<float>& out) {
  resize_anew(out, order.size());
  for_samples(order.size(), [&](std::size_t k) { out[k] = from[order[k].sample]; });
}

/// The box that the supports of a cluster's samples reach. 64 bits hold what passes the range of steps.
class ReachedBox {
 public:
  void include(const std::array<std::int32_t, 3>& place, float support) {
    constexpr float kFarthest = 1e10F;  // beyond all steps from anywhere
    const auto radius = static_cast<std::int64_t>(std::ceil(std::min(kFarthest, support)));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      low_[axis] = std::min(low_[axis], place[axis] - radius);
      high_[axis] = std::max(high_[axis], place[axis] + radius);
    }
  }
  [[nodiscard]] SampleCluster cluster(std::size_t begin, std::size_t end) const {
    SampleCluster c{static_cast<std::uint32_t>(begin), static_cast<std::uint32_t>(end), {}, {}};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      c.low[axis] = static_cast<std::int32_t>(std::max<std::int64_t>(low_[axis], kLeast));
      c.high[axis] = static_cast<std::int32_t>(std::min<std::int64_t>(high_[axis], kMost));
    }
    return c;
  }

 private:
  std::array<std::int64_t, 3> low_{kMost, kMost, kMost}, high_{kLeast, kLeast, kLeast};
};

/// Those that begin in [begin, end) of the order.
std::vector<SampleCluster> clusters_within(const std::vector<Keyed>& order, const ClusteredBucket& in,
                                           std::size_t begin, std::size_t end) {
  std::vector<SampleCluster> out;
  while (begin > 0 && begin < end && order[begin].key == order[begin - 1].key) ++begin;
  for (std::size_t next = begin; begin < end; begin = next) {
    ReachedBox reach;
    for (; next < order.size() && order[next].key == order[begin].key; ++next)
      reach.include({in.x[next], in.y[next], in.z[next]}, in.support[next]);
    out.push_back(reach.cluster(begin, next));
  }
  return out;
}

void find_clusters(const std::vector<Keyed>& order, ClusteredBucket& out) {
  std::vector<std::vector<SampleCluster>> pieces((order.size() + kSampleGrain - 1) / kSampleGrain);
  tbb::parallel_for(std::size_t{0}, pieces.size(), [&](std::size_t p) {
    const std::size_t begin = p * kSampleGrain;
    pieces[p] = clusters_within(order, out, begin, std::min(begin + kSampleGrain, order.size()));
  });
  out.clusters.clear();
  for (const auto& piece : pieces) out.clusters.insert(out.clusters.end(), piece.begin(), piece.end());
}

void fill(const ActiveBucket& bucket, const std::vector<Keyed>& order, ClusteredBucket& out) {
  const LocalSamples& s = bucket.samples;
  for (auto* values : {&out.x, &out.y, &out.z}) resize_anew(*values, order.size() + ClusteredBucket::kBehind);
  resize_anew(out.support, order.size() + ClusteredBucket::kBehind);
  resize_anew(out.samples, order.size());
  for_samples(order.size(), [&](std::size_t k) {
    const std::uint32_t i = order[k].sample;
    out.x[k] = s.x[i];
    out.y[k] = s.y[i];
    out.z[k] = s.z[i];
    out.support[k] = bucket.support[i];
    out.samples[k] = {s.nx[i], s.ny[i], s.nz[i], bucket.weight[i], bucket.band[i]};
  });
  out.attributes.resize(s.attributes.size() + (bucket.residual.empty() ? 0 : kResidualSums));
  for (std::size_t a = 0; a < s.attributes.size(); ++a) pick(s.attributes[a], order, out.attributes[a]);
  if (!bucket.residual.empty()) {
    pick(bucket.residual, order, out.attributes.end()[-2]);
    out.attributes.back().resize(order.size());
    std::transform(out.attributes.end()[-2].begin(), out.attributes.end()[-2].end(), out.attributes.back().begin(),
                   [](float r) { return r * r; });
  }
  find_clusters(order, out);
}

}  // namespace

void cluster_samples(const ActiveBucket& bucket, const Lattice& lattice, ClusterScratch& scratch,
                     ClusteredBucket& out) {
  // A thread that waits for others here must not begin with another bucket: the scratch is in use.
  tbb::this_task_arena::isolate([&] { fill(bucket, in_order(bucket, lattice, scratch), out); });
}

}  // namespace lamina
