// The out-of-core store: samples bucketed along the sweep axis, Blosc-compressed blocks in temporary files.
#pragma once
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "lamina/attributes.h"

namespace lamina {

/// Samples in fixed-point local coordinates; arrays are parallel, optional ones empty.
struct LocalSamples {
  std::vector<std::int32_t> x, y, z;           ///< steps of the frame
  std::vector<float> nx, ny, nz;               ///< unit normals in the local frame; the store keeps them within 5e-7
  std::vector<float> radius;                   ///< influence radius in steps, when the input gave one
  std::vector<float> quality;                  ///< when the input gave one
  std::vector<std::vector<float>> attributes;  ///< one array per attribute
  [[nodiscard]] std::size_t size() const { return x.size(); }
  void clear();                 ///< no samples; keeps memory and the number of attributes
  void reserve(std::size_t n);  ///< positions, normals and the attributes there are
};

/// Samples of a bucket that a thread takes at a time: few enough that a dozen threads have work.
inline constexpr std::size_t kSampleGrain = 2048;
/// Samples of several buckets that all threads work on together, where buckets are small.
inline constexpr std::uint64_t kSamplesTogether = 1U << 15;

/// What is read of a bucket's samples.
enum class Columns : std::uint8_t { all, positions };

struct StoreLayout {
  bool has_radius = false;
  bool has_quality = false;
  AttributeLayout attributes;  ///< stored in their own type: 8-bit colours cost a byte. Integers are rounded and
                               ///< clamped to their range, NaN becomes 0; float64 is stored as the float it arrives as
};

struct StoreSettings {
  std::string directory;                 ///< where the temporary files go
  std::int32_t z_min = 0;                ///< bucket 0 begins here; lower samples go to bucket 0
  std::int32_t bucket_height = 1;        ///< steps, > 0
  std::size_t buckets = 1;               ///< samples above the last bucket go to the last
  std::size_t buffer_bytes = 32u << 20;  ///< memory for all unwritten samples together, compression included; in
                                         ///< random order 32 KB per bucket make blocks of about 1200 coloured samples,
                                         ///< 8 KB of 280 (a block costs 16 bytes of index)
  bool keep = false;                     ///< named files that stay, with checksums: SlabStore::save() completes them
};

/// What the finished store holds. Order inside a bucket is the order of append().
class SlabStore {
 public:
  ~SlabStore();
  SlabStore(SlabStore&&) noexcept;
  SlabStore& operator=(SlabStore&&) noexcept;
  /// Opens a store that was kept and saved in `directory`. Nothing of it is changed or given back. Throws
  /// Error(unreadable) naming the file that is missing, damaged or of another version.
  static SlabStore open(const std::string& directory, const StoreLayout& layout);
  /// Writes a kept store's index; returns a checksum over it and, through it, all the store's blocks. Throws
  /// Error(budget) when it cannot be written.
  [[nodiscard]] std::uint32_t save() const;
  /// The same of the index as it was saved.
  [[nodiscard]] std::uint32_t checksum() const;

  [[nodiscard]] const StoreLayout& layout() const;
  [[nodiscard]] std::size_t buckets() const;
  [[nodiscard]] std::uint64_t count(std::size_t bucket) const;
  /// The first bucket with samples from `bucket` on, buckets() when there is none.
  [[nodiscard]] std::size_t next_filled(std::size_t bucket) const;
  [[nodiscard]] std::int32_t z_lower(
      std::size_t bucket) const;  ///< smallest z stored in the bucket (exact); greatest int32 when it is empty
  [[nodiscard]] std::int32_t z_upper(
      std::size_t bucket) const;  ///< largest z stored in the bucket (exact); least int32 when it is empty
  [[nodiscard]] std::uint64_t total() const;
  [[nodiscard]] std::uint64_t disk_bytes() const;  ///< not given back
  [[nodiscard]] std::size_t files() const;         ///< that the buckets are in, each a run of them
  /// Decompresses one bucket into `out` (resized to it; what is not wanted is left empty); safe from several threads.
  /// Throws Error(budget) naming the directory when the file cannot be read or is damaged; of a kept store
  /// Error(unreadable) naming the file.
  void read(std::size_t bucket, LocalSamples& out, Columns wanted = Columns::all) const;
  /// Leaves samples out for good: keep[b][i] says whether sample i of bucket b stays, as read() has given it so far.
  /// Counts and bounds become those of the samples that stay. Their disk space is not given back. Reads every bucket
  /// that loses samples, and throws what read() does.
  void keep_only(std::vector<std::vector<bool>> keep);
  /// Says that a bucket will be read soon, so that a slow disk begins to.
  void will_read(std::size_t bucket) const;
  /// Says that buckets before this one will not be read again. Their disk space is given back, a file at a
  /// time, unless the store is kept.
  void release_before(std::size_t bucket);

 private:
  friend class SlabStoreWriter;
  friend struct StoreAccess;  ///< of those that move blocks between stores
  struct Impl;
  explicit SlabStore(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// Fills a store. Its temporary files are unlinked at creation, so they are gone whatever happens.
class SlabStoreWriter {
 public:
  /// Throws Error(budget) when the directory does not exist or cannot be written, naming it.
  SlabStoreWriter(StoreLayout layout, StoreSettings settings);
  ~SlabStoreWriter();
  SlabStoreWriter(const SlabStoreWriter&) = delete;
  SlabStoreWriter& operator=(const SlabStoreWriter&) = delete;
  /// Appends samples in order; their arrays must be those of the layout (else Error(internal)). Throws Error(budget)
  /// when the disk is full, naming directory and bytes written.
  void append(const LocalSamples& samples);
  /// Writes what is left; the writer is spent afterwards (a further append or finish throws Error(internal)).
  SlabStore finish();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace lamina
