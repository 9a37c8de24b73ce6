// Samples as they come from a file, in its own coordinates.
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

namespace lamina {

/// Structure of arrays; every non-empty array has size() entries. Reused between reads to keep its memory.
struct SampleBatch {
  std::uint64_t first = 0;                     ///< row number in the input of the first sample
  std::vector<double> x, y, z;                 ///< positions, input coordinates
  std::vector<float> nx, ny, nz;               ///< normals as read (any length), empty when the source has none
  std::vector<float> radius;                   ///< influence radius, input units; empty when the source has none
  std::vector<float> quality;                  ///< quality or confidence; empty when the source has none
  std::vector<std::vector<float>> attributes;  ///< one array per attribute of the source's layout
  /// One array per attribute: the values of those whose type a float cannot hold (ids, times), empty for the others.
  /// Sources fill it; who makes batches may leave it empty.
  std::vector<std::vector<double>> exact;

  [[nodiscard]] std::size_t size() const { return x.size(); }
};

/// What a job does about samples it cannot use.
enum class BadSamples { drop, refuse };

}  // namespace lamina
