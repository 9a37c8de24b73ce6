// Cleaning between reading and reconstructing: duplicates, outliers and samples too close together leave a slab store.
#pragma once
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "lamina/clean.h"
#include "samples/outliers.h"
#include "store/ingest.h"
#include "store/slab_store.h"

namespace lamina {

/// Greedy, in the order of the samples: one is left out when a kept one lies within the distance and its normal does
/// not point the other way. Buckets come by ascending z; kept samples that lie farther below than the distance are
/// forgotten.
class Thinner {
 public:
  /// `distance` in steps, >= 0.
  explicit Thinner(double distance);

  /// Clears keep[i] for those left out; the ones it finds cleared are not there. Returns how many it has cleared.
  std::uint64_t thin(const LocalSamples& samples, std::vector<bool>& keep);

 private:
  struct Kept {
    std::int32_t x, y, z;
    float nx, ny, nz;
    std::uint32_t next;  ///< of the same place in the table
  };
  static constexpr std::uint32_t kNone = 0xFFFFFFFF;
  [[nodiscard]] std::size_t place(std::int64_t x, std::int64_t y, std::int64_t z) const;
  [[nodiscard]] std::size_t home(const Kept& k) const;
  [[nodiscard]] bool is_near_kept(const Kept& sample) const;
  void forget_below(std::int64_t z);
  void rehash(std::size_t least);

  double distance_, squared_;
  std::int64_t cell_;  ///< edge of the table's cells, at least twice the distance: a ball meets eight of them at most
  std::vector<Kept> kept_;
  std::vector<std::uint32_t> heads_;  ///< by the hash of a cell; their number is a power of two
};

/// What is asked for, and where.
struct Cleaning {
  CleanSettings settings;
  double step = 1;        ///< input units per fixed-point step
  std::string directory;  ///< of temporary files
  /// Where given, is told what is left out while the store still has it.
  std::function<void(const Reasons&)> rejected{};
};

/// Carries out the steps that look around; counts go to `counts`. Memory: a bit for each sample and what the steps
/// need. Returns which samples stay, by bucket.
KeepMasks choose_samples(const SlabStore& store, const Cleaning& cleaning, CleanCounts& counts, const RunContext& run);

/// The same on what has been read; the samples left out are never read again. `name`: of the input, for messages.
/// Throws Error(empty) when nothing is left.
void clean_ingested(Ingested& in, const Cleaning& cleaning, const std::string& name, CleanCounts& counts,
                    const RunContext& run);

/// What the settings leave out, in words: others where other samples stay; empty where all do.
std::string cleaning_words(const CleanSettings& settings);

}  // namespace lamina
