// Normals better than the input's, found from the samples around as these pass.
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

#include "samples/bucket_cache.h"

namespace lamina {

struct UnitNormals {
  std::vector<float> x, y, z;
};

/// Buckets come in ascending order with the input's normals, and get theirs when all that may act on them has come.
class NormalFilter {
 public:
  NormalFilter() = default;
  virtual ~NormalFilter() = default;
  NormalFilter(const NormalFilter&) = delete;
  NormalFilter& operator=(const NormalFilter&) = delete;
  /// As far as samples act, steps.
  [[nodiscard]] virtual double reach() const = 0;
  /// A bucket's samples and the radii they have (steps; 0: left out).
  virtual void add(std::size_t bucket, const LocalSamples& samples, const std::vector<float>& radii) = 0;
  /// Of a bucket that was added, in its order; all samples within reach() have been added.
  virtual UnitNormals find(std::size_t bucket) = 0;
  /// Samples below z act on nothing more.
  virtual void forget_below(std::int64_t z) = 0;
};

}  // namespace lamina
