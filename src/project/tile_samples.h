// Finding the samples of a tile: binning with halo, and gathering in rows.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "feed/sample_feed.h"
#include "project/kernel.h"
#include "window/window.h"

namespace lamina {

/// Samples per tile, compressed rows: tile t owns index[begin[t] .. begin[t + 1]), ascending; an index counts through
/// the buckets of the batch.
struct TileBins {
  std::vector<std::uint64_t> begin;
  std::vector<std::uint32_t> index;
};

/// Bins a batch into the tiles of a level: a sample goes to every tile that has a lattice point (of the layers [first,
/// end)) within its support + margin. Points lie `shift` cells above the corners (0: corners, 0.5: cell centres).
/// `tiles` are distinct and in canonical order (z, y, x). Deterministic for any number of threads.
TileBins bin_samples(const Lattice& lattice, int level, const Batch& batch, std::int32_t first, std::int32_t end,
                     std::span<const Block> tiles, float margin, double shift);

/// What projection needs of a sample, side by side: tiles pick their samples here and there, each from one line of the
/// cache.
struct PackedSample {
  std::int32_t x, y, z;  ///< steps
  float nx, ny, nz;
  float cell;             ///< of its level, steps
  float support, weight;  ///< as in ActiveBucket
};
struct PackedBatch {
  std::vector<PackedSample> samples;  ///< bucket after bucket, as TileBins counts them
  std::size_t attribute_count = 0;
  std::vector<float> attributes;  ///< sample after sample
};
/// Reuses what `out` holds.
void pack(const Batch& batch, const Lattice& lattice, PackedBatch& out);

/// A tile's samples sorted by rows of cells (z, then y; inside a row in the order of the batch).
class RowSamples {
 public:
  static constexpr int kLow =
      -4;  ///< rows of cells kLow .. kLow + kRows - 1 relative to the tile; outer ones are clamped
  static constexpr int kRows = 16;

  /// `band`: ProjectSettings::band.
  void gather(const Lattice& lattice, int level, const Block& block, const PackedBatch& batch,
              const std::uint32_t* index, std::size_t count, float band);
  [[nodiscard]] const TileSamples& samples() const { return samples_; }
  /// Ranges of samples within the largest support of a box (cells relative to the tile); `out` has kRows entries.
  int ranges(float y_lo, float y_hi, float z_lo, float z_hi, SampleRange* out) const;

 private:
  TileSamples samples_;
  float max_support_ = 0;
  std::vector<std::uint32_t> row_begin_;
  std::vector<std::uint16_t> row_;
};

}  // namespace lamina
