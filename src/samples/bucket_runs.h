// Successive buckets of a store that a survey looks at together, and the samples around some of theirs.
#pragma once
#include <cstddef>
#include <cstdint>
#include <functional>
#include <unordered_map>
#include <vector>

#include <Eigen/Core>

#include "base/hashing.h"
#include "store/slab_store.h"

namespace lamina {

/// Fills a bucket's samples in, as SlabStore::read() does.
using ReadBucket = std::function<void(std::size_t bucket, LocalSamples& out)>;

/// The store's own.
ReadBucket reader_of(const SlabStore& store);

/// Buckets [begin, end).
struct BucketSpan {
  std::size_t begin = 0, end = 0;
};

std::uint64_t samples_in(const SlabStore& store, BucketSpan run);

/// The lowest sample and the highest, steps; the greatest int32 and the least where there is none.
struct ZRange {
  std::int32_t low = 0, high = 0;
  [[nodiscard]] double height() const { return static_cast<double>(high) - low; }
};
ZRange z_range(const SlabStore& store, BucketSpan run);

/// Positions, normals and, where the input gave them, radii of a run's samples: buckets in ascending order, in each the
/// input's order.
LocalSamples read_oriented(const SlabStore& store, const ReadBucket& read, BucketSpan run);

/// Samples in cells as wide as neighbours are looked for, those around the seeds only.
class SeedNeighbourhoods {
 public:
  /// `reach`: of neighbours, steps, > 0. `samples` must outlive it.
  SeedNeighbourhoods(const LocalSamples& samples, double reach, std::vector<std::size_t> seeds);

  [[nodiscard]] const std::vector<std::size_t>& seeds() const { return seeds_; }
  /// Zero where there is none.
  [[nodiscard]] Eigen::Vector3d normal(std::size_t sample) const {
    if (samples_.nx.size() != samples_.size()) return Eigen::Vector3d::Zero();
    return Eigen::Vector3f(samples_.nx[sample], samples_.ny[sample], samples_.nz[sample]).cast<double>();
  }
  /// Calls visit(sample, place) for the samples within reach of a seed, itself left out; `place` is relative to the
  /// seed, in units of the reach.
  template <class Visit>
  void around(std::size_t seed, const Visit& visit) const {
    const Cell c = cell_of(seed);
    for (int k = 0; k < 27; ++k) {
      for (const std::uint32_t i : cells_.at(beside(c, k))) {
        if (i == seed) continue;
        const Eigen::Vector3d p = Eigen::Vector3d(static_cast<double>(samples_.x[i]) - samples_.x[seed],
                                                  static_cast<double>(samples_.y[i]) - samples_.y[seed],
                                                  static_cast<double>(samples_.z[i]) - samples_.z[seed]) *
                                  inverse_;
        if (p.squaredNorm() < 1) visit(i, p);
      }
    }
  }

 private:
  struct Cell {
    std::int64_t x, y, z;
    bool operator==(const Cell&) const = default;
  };
  struct Hash {
    std::size_t operator()(const Cell& c) const { return cell_hash(c.x, c.y, c.z); }
  };
  static Cell beside(const Cell& c, int k) { return {c.x + k % 3 - 1, c.y + k / 3 % 3 - 1, c.z + k / 9 - 1}; }
  [[nodiscard]] Cell cell_of(std::size_t i) const;

  const LocalSamples& samples_;
  double inverse_;
  std::vector<std::size_t> seeds_;
  std::unordered_map<Cell, std::vector<std::uint32_t>, Hash> cells_;
};

}  // namespace lamina
