// Cleaning between reading and reconstructing: duplicates, outliers and samples too close together leave a slab store.
#pragma once
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "lamina/clean.h"
#include "lamina/run.h"
#include "store/ingest.h"
#include "store/slab_store.h"

namespace lamina {

/// Which samples of each bucket stay. Where only some are meant, a bucket that has none of them may have no mask.
using KeepMasks = std::vector<std::vector<bool>>;

/// Why samples of each bucket do not stay: the number of a reason, 0 where they do. A bucket that loses none may have
/// no list.
using Reasons = std::vector<std::vector<std::uint8_t>>;
enum Reason : std::uint8_t {
  kReasonMerged = 1,
  kReasonOutlier = 2,
  kReasonLonely = 3,      ///< a stray far from its neighbours
  kReasonOffSurface = 4,  ///< a stray on no surface of its neighbours
  kReasonThinned = 5,
};

// Statistical outliers: samples whose nearest neighbours are much farther away than is usual in the cloud (Rusu et al.
// 2008, "Towards 3D point cloud based object maps for household environments").

/// Positions in fixed-point steps; parallel arrays.
struct Positions {
  std::vector<std::int32_t> x, y, z;
  [[nodiscard]] std::size_t size() const { return x.size(); }
};

/// Neighbours are looked for as far as so many cells, a dozen spacings; farther ones count as if they were there.
inline constexpr int kFarthestCells = 6;

/// For each of the first `wanted` positions the mean distance (steps) to its `neighbours` nearest among all the others,
/// distances beyond kFarthestCells cells counting as that. Depends on the set of positions alone. `cell` >= 1024.
std::vector<float> mean_distances(const Positions& positions, std::size_t wanted, std::uint32_t neighbours,
                                  std::int32_t cell);

/// The least cell, half octaves from 1024 on, that holds `wanted` of the positions on average, empty ones not counted.
std::int32_t counting_cell(const Positions& positions, double wanted);

struct OutlierRule {
  std::uint32_t neighbours = 16;
  double sigma = 2;
};

struct Outliers {
  std::uint64_t count = 0;
  double limit = 0;  ///< mean distance from which on samples are outliers, steps
};

/// Clears the masks of outliers; the samples they find cleared are not there. Slides over the store; memory holds the
/// positions of a dozen spacings of its height, an unnamed file in `directory` four bytes for each sample.
Outliers drop_outliers(const SlabStore& store, const OutlierRule& rule, const std::string& directory, KeepMasks& masks,
                       const RunContext& run);

// Stray samples: those that lie on no surface of their neighbours. What scanners put in front of and behind edges,
// dust, rain and reflections leave by a test that looks at each sample's own neighbourhood, so that it holds wherever
// the density varies.

/// Nearest samples that a sample is compared with.
inline constexpr std::size_t kStrayNeighbours = 12;
/// A sample is lonely when its neighbours are so many times farther away than theirs are. On a surface sampled at
/// random the ratio is under 2; where density changes by a step it is that of the spacings, on one side of the step
/// alone.
inline constexpr float kLonely = 2.5F;
/// Neighbours lie on the surface of a sample when they are within this share of the neighbourhood's radius of its
/// tangent plane and their normal lies within this cosine (75 degrees) of its own. Which of the two ways they face is
/// not asked: it is often wrong.
inline constexpr float kNearPlane = 0.5F;
inline constexpr float kAlongSurface = 0.26F;
/// Which of two ways they face is asked where the neighbours agree among themselves: where the mean of their normals is
/// at least so long. That of a dozen normals with signs by chance is a third.
inline constexpr float kAgreeing = 0.7F;
/// A sample lies on no surface when fewer of its neighbours than this share do: of a ball filled at random a third is
/// near the plane, and a third of those face along it; at a right edge half of them do.
inline constexpr float kLeastOnSurface = 0.35F;
/// At the corner of a cube a third of them do, but these exactly: within so little of the plane, facing the same way to
/// within 25 degrees. Where so large a share does the sample stays; chance puts one in twenty so near.
inline constexpr float kOnPlane = 0.05F;
inline constexpr float kSameWay = 0.9F;
inline constexpr float kLeastExact = 0.2F;
/// A few strays far from everything but each other have chance company, and most of so few lie near the plane of one of
/// them. Where fewer neighbours are found than are looked for, though there are many not much farther away, more is
/// asked for: so many neighbours, so large a share of them on the sample's surface.
inline constexpr std::size_t kLeastCompany = 6;
inline constexpr float kLeastOnSparseSurface = 0.5F;
/// Many: within twice the distance a surface of even density has four times as many.
inline constexpr std::size_t kManyBeside = 64;

struct StrayCounts {
  std::uint64_t lonely = 0;       ///< far from their neighbours
  std::uint64_t off_surface = 0;  ///< on no surface of their neighbours
  [[nodiscard]] std::uint64_t all() const { return lonely + off_surface; }
};

/// What the store's normals say: measured ones tell more than those found from the positions.
enum class SampleNormals : std::uint8_t { given, found, none };

/// Clears the masks of stray samples; those they find cleared are not there. Strays left over are judged without those
/// found first, and samples too sparse to have a dozen neighbours by each other; where normals were not measured, those
/// far from their neighbours by find_clutter() in the end. `reasons`: where wanted, is told of each. Depends on the
/// cloud alone. Memory: some 60 bytes for each sample of twelve dozen spacings of the cloud's height, a bit for each of
/// the cloud, and of buckets with samples too sparse three more.
StrayCounts drop_strays(const SlabStore& store, KeepMasks& masks, SampleNormals normals, const RunContext& run,
                        Reasons* reasons = nullptr);

// Thinning, and all steps in their order.

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
  SampleNormals normals = SampleNormals::given;
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
