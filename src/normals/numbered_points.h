// Positions and usable normals of a source with the number of each row: what the slab store carries for this job.
#pragma once
#include <cstdint>
#include <vector>

#include "lamina/points.h"
#include "lamina/slab_store.h"

namespace lamina::normals {

/// What else the source has is left out. Rows without a usable normal get one that says nothing.
class NumberedPoints final : public PointSource {
 public:
  NumberedPoints(PointSource& source, bool with_normals);
  void read(std::uint64_t first, std::size_t count, SampleBatch& out) override;

 private:
  PointSource& source_;
  bool with_normals_;
};

/// Row of sample i of the store, and whether its normal is the input's.
std::uint64_t row_of(const LocalSamples& samples, std::size_t i);
bool has_given_normal(const LocalSamples& samples, std::size_t i);

}  // namespace lamina::normals
