// Hands the stages their samples: buckets of the store with radii, levels and weights, read again whenever they are
// needed and kept only within a budget (samples are streamed again, never stored per cell: Cuccuru et al.
// 2009, section 3.4).
#pragma once
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <unordered_map>
#include <vector>

#include "lamina/length.h"
#include "lattice/lattice.h"
#include "samples/bucket_cache.h"
#include "samples/bucket_runs.h"
#include "samples/radii_ahead.h"
#include "samples/radius_estimator.h"
#include "samples/sheet_refinement.h"
#include "samples/support_field.h"
#include "store/slab_store.h"

namespace lamina {

/// Unit normals and, where surfaces were fitted to find them, how far outside of its own each sample lies, steps.
struct FilteredNormals {
  std::vector<float> x, y, z;
  std::vector<float> residual;  ///< empty: not known
};

/// Normals better than the input's, found from the samples around as these pass.
/// Buckets come in ascending order with the input's normals, and get theirs when all that may act on them has come.
class NormalFilter {
 public:
  NormalFilter() = default;
  virtual ~NormalFilter() = default;
  NormalFilter(const NormalFilter&) = delete;
  NormalFilter& operator=(const NormalFilter&) = delete;
  /// As far as samples act, steps.
  [[nodiscard]] virtual double halo() const = 0;
  /// A bucket's samples and the radii they have (steps; 0: left out).
  virtual void add(std::size_t bucket, const LocalSamples& samples, const std::vector<float>& radii) = 0;
  /// Of a bucket that was added, in its order; all samples within halo() have been added.
  virtual FilteredNormals find(std::size_t bucket) = 0;
  /// Samples below z act on nothing more.
  virtual void forget_below(std::int64_t z) = 0;
};

using Batch = std::vector<std::shared_ptr<const ActiveBucket>>;

struct FeedSettings {
  float radius_scale = 1;  ///< multiplies estimated radii; given ones are scaled when read in
  double blend = 1;        ///< H: a sample's support radius R_i is H r_i, about that where it follows places
  std::shared_ptr<const SupportField> support;  ///< H by place; null: the same everywhere
  /// Largest leaf cell that a sample allows: a length, the same for all, or a multiple of its r_i or R_i.
  Length cell{0.9, Length::Unit::influence_radius};
  bool refine_sheets = false;  ///< a level less where sheets lie close together (SheetRefinement)
  /// A corner keeps a value only if a sample lies this near, in cells of the sample's level ...
  float band_cells = 2.25F;
  float band_radii = 0;                 ///< ... or in its r_i, whichever is more
  float max_radius = 0;                 ///< samples with a larger r_i are left out, steps; 0: none
  std::size_t cache_bytes = 64u << 20;  ///< memory for samples kept between uses
  /// Samples looked at together: all that act on a slab of 10^9 samples, since sums that wait for the next batch double
  /// the cost; few enough to stay in memory whatever H is.
  std::uint64_t batch_samples = 1u << 20;

  /// Every sample asks for the finest level.
  [[nodiscard]] bool fixed_cell() const { return cell.unit == Length::Unit::world; }
  [[nodiscard]] bool refines_sheets() const { return refine_sheets && !fixed_cell(); }
  /// The largest leaf cell in units of R_i (or, in units of r_i, where cells do not follow the support).
  [[nodiscard]] double cell_ratio() const { return fixed_cell() ? 1.0 : cell.value; }
  /// The largest H of a sample.
  [[nodiscard]] double widest() const { return support ? static_cast<double>(support->most()) : blend; }
  [[nodiscard]] bool cell_follows_support() const { return cell.unit != Length::Unit::sample_radius; }
};

/// Largest influence a sample can have, steps.
float support_limit(const FeedSettings& settings, const Lattice& lattice);

struct FeedCounts {
  std::uint64_t samples = 0;       ///< that have got a radius
  std::uint64_t undersampled = 0;  ///< left out by max_radius
  std::uint64_t clamped = 0;       ///< radius reduced to what the coarsest level can serve
  std::uint64_t bucket_reads = 0;  ///< times a bucket was decompressed
};

/// How far along z what a sample gets depends on others; heights of cells lying on multiples of theirs, 0 where nothing
/// of the kind is done. In steps.
struct FeedHalo {
  std::int64_t counting_cell = 0;  ///< radii depend on the coarsest counting cells above and below the sample's
  double normal_filter = 0;        ///< normals on samples as far as NormalFilter::halo()
  std::int64_t sheet_cell = 0;     ///< levels on the coarsest cells above and below the sample's
};
/// `filter_halo`: NormalFilter::halo(), 0 without one.
FeedHalo feed_halo(const FeedSettings& settings, const Lattice& lattice, const RadiiSettings& radii, bool given_radii,
                   double filter_halo = 0);

/// The buckets that a feed reads which begins at `from` (begin_at(); nothing: at the bottom) and prepares all below
/// `to`: it may look for more, but does without them.
BucketSpan buckets_read(const SlabStore& store, const FeedHalo& halo, std::optional<std::int64_t> from,
                        std::int64_t to);

/// Buckets go by ascending z: prepare() runs ahead, release() follows behind. Inside a bucket samples are sorted by
/// blocks of cells (sort_by_block()): successive ones lie close to each other, which the stages may rely on for
/// speed. The next buckets are read while the stages work.
class SampleFeed {
 public:
  /// Gives buckets released back to the store.
  SampleFeed(SlabStore& store, const Lattice& lattice, const FeedSettings& settings, const RadiiSettings& radii,
             bool given_radii);

  /// Normals come from this filter, which must outlive the feed. Called before anything else.
  void filter_normals(NormalFilter& filter) { filter_ = &filter; }

  /// Leaves out what lies below, before anything else is asked for: buckets with a sample at or above z get the radii,
  /// and so come in the batches, of a feed that begins at the bottom; buckets below may have other radii.
  void begin_at(std::int64_t z);

  /// Called for all buckets in ascending order, some at a time, once their radii are known.
  using OnReady = std::function<void(const Batch&)>;
  /// Makes sure the radii of all samples with z < limit are known.
  void prepare(std::int64_t z_limit, const OnReady& on_ready);
  /// Begins in the background what prepare() will have to do for its next limit, and some of what it will for the one
  /// after that.
  void look_ahead(std::int64_t next, std::int64_t after_that);
  /// Samples whose influence meets z in [lo, hi), batch after batch; how they are cut into batches depends on the cloud
  /// alone. `margin` enlarges every influence (steps).
  [[nodiscard]] std::vector<std::vector<std::size_t>> batches(std::int64_t lo, std::int64_t hi, float margin) const;
  [[nodiscard]] Batch load(const std::vector<std::size_t>& batch);
  /// Forgets the samples of a bucket, of which the caller keeps what it needs; load() would read them again.
  void set_aside(std::size_t bucket) { cache_.drop(bucket); }
  /// Forgets buckets that end below z.
  void release(std::int64_t z);
  [[nodiscard]] std::uint64_t released() const { return released_; }              ///< samples forgotten so far
  [[nodiscard]] std::uint64_t disk_bytes() const { return store_.disk_bytes(); }  ///< of the store, now
  [[nodiscard]] FeedCounts counts() const;
  /// Largest influence a sample can have, steps: the look-ahead that prepare() needs.
  [[nodiscard]] float support_limit() const { return support_limit_; }

 private:
  struct Known {
    std::vector<float> radius;  ///< r_i, steps
    float max_support = 0;
    FilteredNormals normals;          ///< where they are filtered
    std::vector<std::uint8_t> finer;  ///< 1: the sample takes a level less; empty: none does
  };
  void annotate(std::size_t bucket, ActiveBucket& out) const;
  std::shared_ptr<const ActiveBucket> fetch(std::size_t bucket);
  [[nodiscard]] bool begins_below(std::size_t bucket, std::int64_t z) const;
  // A bucket passes these steps, each when the buckets around have passed the one before.
  void take_measured();
  void learn_radii();
  bool orient_next();  ///< false: not yet
  [[nodiscard]] std::vector<std::size_t> settle_below(std::int64_t z_limit);
  void hand_over(const std::vector<std::size_t>& buckets, const OnReady& on_ready);
  /// Least z of the samples from a bucket on, beyond all z when there are none.
  [[nodiscard]] std::int64_t first_from(std::size_t bucket) const;

  SlabStore& store_;
  Lattice lattice_;
  FeedSettings settings_;
  RadiiSettings radii_settings_;
  std::unique_ptr<RadiiAhead> measuring_;    ///< null when the input gave radii
  std::deque<std::vector<float>> radii_;     ///< of the buckets from measured_ on
  std::unique_ptr<SheetRefinement> sheets_;  ///< null where sheets are not refined
  float support_limit_;
  float radius_limit_;
  std::size_t announced_ = 0;  ///< buckets the system knows are wanted, where radii are given
  std::size_t measured_ = 0;   ///< buckets with known radii
  std::size_t oriented_ = 0;   ///< of these, with their final normals
  std::size_t ready_ = 0;      ///< of these, with their final levels
  std::size_t first_ = 0;      ///< first bucket not released
  NormalFilter* filter_ = nullptr;
  std::unordered_map<std::size_t, Known> known_;
  BucketCache cache_;
  std::uint64_t released_ = 0;
  FeedCounts counts_;
};

}  // namespace lamina
