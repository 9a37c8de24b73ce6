#include "store/slab_store.h"

#include <fmt/format.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <memory>
#include <utility>

#include "lamina/error.h"
#include "store/block_codec.h"

namespace lamina {

void LocalSamples::clear() {
  for (auto* a : {&x, &y, &z}) a->clear();
  for (auto* a : {&nx, &ny, &nz, &radius, &quality}) a->clear();
  for (auto& a : attributes) a.clear();
}

void LocalSamples::reserve(std::size_t n) {
  for (auto* a : {&x, &y, &z}) a->reserve(n);
  for (auto* a : {&nx, &ny, &nz}) a->reserve(n);
  for (auto& a : attributes) a.reserve(n);
}

namespace {

/// Of samples, [begin, end).
struct KeptRun {
  std::ptrdiff_t begin, end;
};

/// Few samples are left out: the others are moved run by run, and not asked about one by one for each array.
std::vector<KeptRun> runs_of(const std::vector<bool>& keep) {
  std::vector<KeptRun> runs;
  auto at = keep.begin();
  while ((at = std::find(at, keep.end(), true)) != keep.end()) {
    const auto end = std::find(at, keep.end(), false);
    runs.push_back({at - keep.begin(), end - keep.begin()});
    at = end;
  }
  return runs;
}

void compact(LocalSamples& s, const std::vector<bool>& keep) {
  const std::vector<KeptRun> runs = runs_of(keep);
  const auto move_up = [&](auto& values) {
    if (values.empty()) return;
    auto out = values.begin();
    for (const KeptRun& run : runs) {
      const auto first = values.begin() + run.begin, last = values.begin() + run.end;
      out = out == first ? last : std::copy(first, last, out);
    }
    values.erase(out, values.end());
  };
  for (auto* v : {&s.x, &s.y, &s.z}) move_up(*v);
  for (auto* v : {&s.nx, &s.ny, &s.nz, &s.radius, &s.quality}) move_up(*v);
  for (auto& v : s.attributes) move_up(v);
}

}  // namespace

SlabStore::SlabStore(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
SlabStore::~SlabStore() = default;
SlabStore::SlabStore(SlabStore&&) noexcept = default;
SlabStore& SlabStore::operator=(SlabStore&&) noexcept = default;

const StoreLayout& SlabStore::layout() const {
  return impl_->layout;
}
std::size_t SlabStore::buckets() const {
  return impl_->buckets.size();
}
std::uint64_t SlabStore::count(std::size_t bucket) const {
  return impl_->buckets[bucket].count;
}
std::size_t SlabStore::next_filled(std::size_t bucket) const {
  while (bucket < buckets() && count(bucket) == 0) ++bucket;
  return bucket;
}
std::int32_t SlabStore::z_lower(std::size_t bucket) const {
  return impl_->buckets[bucket].z_lower;
}
std::int32_t SlabStore::z_upper(std::size_t bucket) const {
  return impl_->buckets[bucket].z_upper;
}
std::uint64_t SlabStore::total() const {
  return impl_->total;
}
std::uint64_t SlabStore::disk_bytes() const {
  std::uint64_t bytes = 0;
  for (const SpillFile& file : impl_->files) bytes += file.size();
  return bytes;
}

std::size_t SlabStore::files() const {
  return impl_->files.size();
}

void SlabStore::read(std::size_t bucket, LocalSamples& out, Columns wanted) const {
  const auto& blocks = impl_->buckets[bucket].blocks;
  const auto& checksums = impl_->buckets[bucket].checksums;
  const auto& keep = impl_->buckets[bucket].keep;
  const auto& columns = impl_->columns;
  const SpillFile& file = impl_->file_of(bucket);
  std::vector<std::size_t> first(blocks.size());
  std::uint64_t here = 0;
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    first[i] = here;
    here += blocks[i].count;
  }
  if (here != (keep.empty() ? count(bucket) : keep.size()))
    throw Error(ExitCode::internal, fmt::format("slab store: bucket {} lies in other stores", bucket));
  columns.resize(out, here, wanted);
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, blocks.size()), [&](const auto& range) {
    std::vector<std::byte> bytes;
    for (std::size_t i = range.begin(); i < range.end(); ++i) {
      bytes.resize(blocks[i].bytes);
      file.read(blocks[i].offset, bytes);
      const bool whole = checksums.empty() || block_checksum(bytes) == checksums[i];
      if (!whole || !decode_block(columns, bytes, blocks[i].count, out, first[i], wanted))
        file.report_damage(blocks[i].offset, fmt::format("samples of bucket {}", bucket));
    }
  });
  if (!keep.empty()) compact(out, keep);
}

void SlabStore::keep_only(std::vector<std::vector<bool>> keep) {
  tbb::enumerable_thread_specific<LocalSamples> read_by_thread;
  tbb::parallel_for(std::size_t{0}, keep.size(), [&](std::size_t b) {
    if (std::find(keep[b].begin(), keep[b].end(), false) == keep[b].end()) return;
    BucketIndex& index = impl_->buckets[b];
    if (index.keep.empty()) {
      index.keep = std::move(keep[b]);
    } else {
      std::size_t n = 0;
      for (auto&& stays : index.keep) stays = stays && keep[b][n++];
    }
    LocalSamples samples = std::move(read_by_thread.local());  // read() may have this thread take another bucket
    read(b, samples);
    index.count = samples.size();
    const BucketIndex none;
    index.z_lower = none.z_lower;
    index.z_upper = none.z_upper;
    for (const std::int32_t z : samples.z) {
      index.z_lower = std::min(index.z_lower, z);
      index.z_upper = std::max(index.z_upper, z);
    }
    read_by_thread.local() = std::move(samples);
  });
  impl_->total = 0;
  for (const BucketIndex& index : impl_->buckets) impl_->total += index.count;
}

void SlabStore::will_read(std::size_t bucket) const {
  const SpillFile& file = impl_->file_of(bucket);
  std::uint64_t begin = 0;
  std::uint64_t end = 0;
  // Blocks next to each other are one request.
  for (const BlockEntry& block : impl_->buckets[bucket].blocks) {
    if (block.offset != end) {
      file.will_read(begin, end - begin);
      begin = block.offset;
    }
    end = block.offset + block.bytes;
  }
  file.will_read(begin, end - begin);
}

void SlabStore::release_before(std::size_t bucket) {
  if (!impl_->directory.empty()) return;
  while (impl_->released < impl_->files.size()) {
    const std::size_t end =
        ((impl_->released + 1) * impl_->buckets.size() + impl_->files.size() - 1) / impl_->files.size();
    if (end > bucket) return;
    impl_->files[impl_->released++].discard();
  }
}

namespace {

constexpr std::size_t kBuffersMoved = 16;
/// A store of several sources holds a part of the buckets: it has more files, so that their disk is given back as soon.
constexpr std::size_t kFilesPerSource = 16, kMostFiles = 128, kBucketsPerPart = 8;

[[noreturn]] void defect(const std::string& what) {
  throw Error(ExitCode::internal, "slab store: " + what);
}

}  // namespace

std::vector<BucketShare> bucket_shares(const SlabStore& store) {
  std::vector<BucketShare> shares;
  for (const BucketIndex& bucket : StoreAccess::of(store).buckets)
    shares.push_back({bucket.count, bucket.z_lower, bucket.z_upper});
  return shares;
}

void declare_shares(SlabStore& store, const std::vector<BucketShare>& all) {
  StoreAccess::Impl& impl = StoreAccess::of(store);
  if (all.size() != impl.buckets.size()) defect("stores with different numbers of buckets are none of one cloud");
  impl.total = 0;
  for (std::size_t b = 0; b < all.size(); ++b) {
    BucketIndex& bucket = impl.buckets[b];
    bucket.count = all[b].count;
    bucket.z_lower = all[b].z_lower;
    bucket.z_upper = all[b].z_upper;
    impl.total += all[b].count;
  }
}

std::span<const BlockEntry> blocks_of(const SlabStore& store, std::size_t bucket) {
  return StoreAccess::of(store).buckets[bucket].blocks;
}

void read_block(const SlabStore& store, std::size_t bucket, const BlockEntry& block, std::span<std::byte> out) {
  const StoreAccess::Impl& impl = StoreAccess::of(store);
  impl.files[bucket * impl.files.size() / impl.buckets.size()].read(block.offset, out);
}

void decode_blocks(const StoreLayout& layout, std::span<const CodedBlock> blocks, LocalSamples& out) {
  const SampleColumns columns(layout);
  std::size_t count = 0;
  for (const CodedBlock& block : blocks) count += block.count;
  columns.resize(out, count);
  std::size_t first = 0;
  for (const CodedBlock& block : blocks) {
    if (!decode_block(columns, block.bytes, block.count, out, first)) defect("a block arrived damaged");
    first += block.count;
  }
}

StoreGatherer::StoreGatherer(const StoreLayout& layout, const std::string& directory,
                             const std::vector<BucketShare>& all, std::size_t sources)
    : store_(new StoreAccess::Impl{
          SampleColumns(layout), layout, {}, std::vector<BucketIndex>(all.size()), 0, 0, std::string()}),
      blocks_(all.size()),
      sources_(sources),
      disk_(SpillFile::kBufferBytes, kBuffersMoved) {
  const std::size_t files =
      std::clamp<std::size_t>(all.size() / kBucketsPerPart, 1, std::min(kMostFiles, kFilesPerSource * sources));
  while (store_->files.size() < files) store_->files.emplace_back(directory);
  for (std::size_t b = 0; b < all.size(); ++b) {
    store_->buckets[b].count = all[b].count;
    store_->buckets[b].z_lower = all[b].z_lower;
    store_->buckets[b].z_upper = all[b].z_upper;
    store_->total += all[b].count;
  }
}

void StoreGatherer::add(std::size_t bucket, std::size_t source, const CodedBlock& block) {
  if (bucket >= blocks_.size() || source >= sources_ || block.count > kBlockRows) defect("a block arrived astray");
  if (blocks_[bucket].empty()) blocks_[bucket].resize(sources_);
  const std::uint64_t offset = store_->file_of(bucket).append(block.bytes, disk_);
  blocks_[bucket][source].push_back({offset, static_cast<std::uint32_t>(block.bytes.size()), block.count});
}

SlabStore StoreGatherer::finish() {
  for (SpillFile& file : store_->files) file.flush(disk_);
  store_->files.front().check(disk_.drain());
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    for (const std::vector<BlockEntry>& of_source : blocks_[b])
      store_->buckets[b].blocks.insert(store_->buckets[b].blocks.end(), of_source.begin(), of_source.end());
  }
  return StoreAccess::make(std::move(store_));
}

}  // namespace lamina
