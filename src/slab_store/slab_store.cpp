#include "lamina/slab_store.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <utility>

#include "lamina/error.h"
#include "slab_store/store_impl.h"

namespace lamina {

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
  for (const TempFile& file : impl_->files) bytes += file.size();
  return bytes;
}

std::size_t SlabStore::files() const {
  return impl_->files.size();
}

void SlabStore::read(std::size_t bucket, LocalSamples& out) const {
  const auto& [blocks, checksums, count, z_lower, z_upper] = impl_->buckets[bucket];
  const auto& columns = impl_->columns;
  const TempFile& file = impl_->file_of(bucket);
  std::vector<std::size_t> first(blocks.size());
  std::uint64_t here = 0;
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    first[i] = here;
    here += blocks[i].count;
  }
  if (here != count) throw Error(ExitCode::internal, fmt::format("slab store: bucket {} lies in other stores", bucket));
  columns.resize(out, count);
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, blocks.size()),
                    [&, &blocks = blocks, &checksums = checksums](const auto& range) {
                      std::vector<std::byte> bytes;
                      for (std::size_t i = range.begin(); i < range.end(); ++i) {
                        bytes.resize(blocks[i].bytes);
                        file.read(blocks[i].offset, bytes);
                        const bool whole = checksums.empty() || block_checksum(bytes) == checksums[i];
                        if (!whole || !decode_block(columns, bytes, blocks[i].count, out, first[i]))
                          file.report_damage(blocks[i].offset, fmt::format("samples of bucket {}", bucket));
                      }
                    });
}

void SlabStore::will_read(std::size_t bucket) const {
  const TempFile& file = impl_->file_of(bucket);
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

}  // namespace lamina
