// Positions and usable normals of a source with the id of each row, its place in the input: what the slab store carries
// for jobs that look at neighbours and come back to rows.
#pragma once
#include <cstdint>
#include <vector>

#include "lamina/points.h"
#include "store/slab_store.h"

namespace lamina {

/// What else the source has is left out. Rows without a usable normal, and all of them without `with_normals`, get
/// (0, 0, 1).
class RowIdSource final : public PointSource {
 public:
  static constexpr std::size_t kDigits = 3;  ///< of a row's id, 16 bits each: the store keeps them in two bytes

  explicit RowIdSource(PointSource& source, bool with_normals = true);
  void read(std::uint64_t first, std::size_t count, SampleBatch& out) override;

 private:
  PointSource& source_;
  bool with_normals_;
};

/// Row of sample i of the store, and whether its normal is the input's.
std::uint64_t row_of(const LocalSamples& samples, std::size_t i);
bool has_given_normal(const LocalSamples& samples, std::size_t i);

}  // namespace lamina
