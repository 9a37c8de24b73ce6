// A store that outlives its run: the index of its blocks beside the files they lie in.
#include <fcntl.h>
#include <fmt/format.h>

#include <zlib.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <string_view>
#include <type_traits>

#include "base/output_file.h"
#include "lamina/error.h"
#include "store/block_codec.h"
#include "store/slab_store.h"

namespace lamina {
namespace {

constexpr std::string_view kMagic = "lamina store 1\n";
/// Of a store that has been cleaned: every bucket's blocks are followed by which of their samples stay. As long as the
/// other.
constexpr std::string_view kCleanedMagic = "lamina store 2\n";
static_assert(kMagic.size() == kCleanedMagic.size());
constexpr const char* kIndexName = "index";

/// Little-endian numbers one after the other.
class Bytes {
 public:
  template <class T>
  void put(T value) {
    static_assert(std::is_arithmetic_v<T>);
    const std::size_t at = data.size();
    data.resize(at + sizeof value);
    std::memcpy(data.data() + at, &value, sizeof value);
  }
  std::vector<std::byte> data;
};

/// What Bytes put, from a file that may be anything; after the end everything is zero.
class ByteReader {
 public:
  explicit ByteReader(std::span<const std::byte> data) : left_(data) {}
  template <class T>
  T take() {
    T value{};
    good_ = good_ && left_.size() >= sizeof value;
    if (!good_) return value;
    std::memcpy(&value, left_.data(), sizeof value);
    left_ = left_.subspan(sizeof value);
    return value;
  }
  [[nodiscard]] std::size_t left() const { return left_.size(); }
  [[nodiscard]] bool good() const { return good_; }

 private:
  std::span<const std::byte> left_;
  bool good_ = true;
};

/// A bit for each sample, lowest first, in whole bytes; none where all stay.
void put_keep(const std::vector<bool>& keep, Bytes& out) {
  out.put(std::uint64_t{keep.size()});
  constexpr std::size_t kBits = 8;
  for (std::size_t i = 0; i < keep.size(); i += kBits) {
    unsigned byte = 0;
    for (std::size_t bit = 0; bit < kBits && i + bit < keep.size(); ++bit) byte |= unsigned{keep[i + bit]} << bit;
    out.put(static_cast<std::uint8_t>(byte));
  }
}

/// False when the bits are not those of so many samples.
bool take_keep(ByteReader& in, std::uint64_t samples, std::vector<bool>& keep) {
  const auto size = in.take<std::uint64_t>();
  constexpr std::uint64_t kBits = 8;
  if (size == 0) return in.good();
  if (size != samples || (size - 1) / kBits >= in.left()) return false;
  keep.resize(size);
  unsigned byte = 0;
  for (std::uint64_t i = 0; i < size; ++i) {
    if (i % kBits == 0) byte = in.take<std::uint8_t>();
    keep[i] = (byte >> (i % kBits) & 1U) != 0;
  }
  return in.good();
}

std::vector<std::byte> index_bytes(std::size_t files, const std::vector<BucketIndex>& buckets) {
  Bytes out;
  const bool cleaned = std::any_of(buckets.begin(), buckets.end(), [](const auto& b) { return !b.keep.empty(); });
  for (const char c : cleaned ? kCleanedMagic : kMagic) out.put(c);
  out.put(std::uint64_t{files});
  out.put(std::uint64_t{buckets.size()});
  for (const BucketIndex& bucket : buckets) {
    out.put(std::uint64_t{bucket.blocks.size()});
    out.put(bucket.z_lower);
    out.put(bucket.z_upper);
    for (std::size_t b = 0; b < bucket.blocks.size(); ++b) {
      out.put(bucket.blocks[b].offset);
      out.put(bucket.blocks[b].bytes);
      out.put(bucket.blocks[b].count);
      out.put(bucket.checksums[b]);
    }
    if (cleaned) put_keep(bucket.keep, out);
  }
  return std::move(out.data);
}

constexpr std::size_t kBlockBytes = 20, kBucketBytes = 16;

[[noreturn]] void damaged(const std::string& path, const std::string& what) {
  throw Error(ExitCode::unreadable, fmt::format("{}: {}; make the store again", path, what));
}

std::vector<std::byte> read_whole(const std::string& path) {
  const Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (!file) damaged(path, fmt::format("cannot be read: {}", system_message(errno)));
  std::vector<std::byte> out;
  constexpr std::size_t kPiece = 1 << 20;
  for (;;) {
    const std::size_t at = out.size();
    out.resize(at + kPiece);
    const ReadResult got = pread_all(file.get(), out.data() + at, kPiece, at);
    if (got.error != 0) damaged(path, fmt::format("cannot be read: {}", system_message(got.error)));
    out.resize(at + got.bytes);
    if (got.bytes < kPiece) return out;
  }
}

}  // namespace

std::uint32_t block_checksum(std::span<const std::byte> block) {
  return static_cast<std::uint32_t>(::crc32_z(0, reinterpret_cast<const Bytef*>(block.data()), block.size()));
}

std::string store_file_name(std::size_t file) {
  return fmt::format("samples.{:02}", file);
}

std::uint32_t SlabStore::checksum() const {
  return block_checksum(index_bytes(impl_->files.size(), impl_->buckets));
}

std::uint32_t SlabStore::save() const {
  if (impl_->directory.empty()) throw Error(ExitCode::internal, "slab store: only one that is kept can be saved");
  std::vector<std::byte> bytes = index_bytes(impl_->files.size(), impl_->buckets);
  const std::uint32_t checksum = block_checksum(bytes);
  Bytes end;
  end.put(checksum);
  bytes.insert(bytes.end(), end.data.begin(), end.data.end());
  OutputFile file(impl_->directory + "/" + kIndexName, {});
  if (const int error = write_all(file.fd(), bytes.data(), bytes.size()); error != 0)
    report_write_error(file.name(), error);
  file.publish();
  return checksum;
}

SlabStore SlabStore::open(const std::string& directory, const StoreLayout& layout) {
  const std::string path = directory + "/" + kIndexName;
  const std::vector<std::byte> bytes = read_whole(path);
  const auto begins_with = [&](std::string_view magic) {
    return bytes.size() >= magic.size() + sizeof(std::uint32_t) &&
           std::memcmp(bytes.data(), magic.data(), magic.size()) == 0;
  };
  const bool cleaned = begins_with(kCleanedMagic);
  if (!cleaned && !begins_with(kMagic)) {
    damaged(path, "is no index of a store, or one of another version");
  }
  const std::span<const std::byte> body(bytes.data(), bytes.size() - sizeof(std::uint32_t));
  if (ByteReader(std::span(bytes).subspan(body.size())).take<std::uint32_t>() != block_checksum(body))
    damaged(path, "is damaged: its checksum is wrong");
  ByteReader in(body.subspan(kMagic.size()));
  const auto files = in.take<std::uint64_t>();
  const auto buckets = in.take<std::uint64_t>();
  constexpr std::uint64_t kMostFiles = 4096;
  if (!in.good() || files == 0 || files > kMostFiles || buckets == 0 || buckets > in.left() / kBucketBytes)
    damaged(path, "is damaged: its counts are wrong");
  std::unique_ptr<Impl> impl(
      new Impl{SampleColumns(layout), layout, {}, std::vector<BucketIndex>(buckets), 0, 0, directory});
  for (std::size_t f = 0; f < files; ++f) impl->files.push_back(SpillFile::open(directory, store_file_name(f)));
  for (std::size_t b = 0; b < buckets; ++b) {
    BucketIndex& bucket = impl->buckets[b];
    const auto blocks = in.take<std::uint64_t>();
    bucket.z_lower = in.take<std::int32_t>();
    bucket.z_upper = in.take<std::int32_t>();
    if (!in.good() || blocks > in.left() / kBlockBytes) damaged(path, "is damaged: it ends too early");
    const std::uint64_t size = impl->file_of(b).size();
    for (std::uint64_t i = 0; i < blocks; ++i) {
      BlockEntry entry;
      entry.offset = in.take<std::uint64_t>();
      entry.bytes = in.take<std::uint32_t>();
      entry.count = in.take<std::uint32_t>();
      if (entry.count > kBlockRows) damaged(path, "is damaged: a block is too large");
      if (entry.offset > size || entry.bytes > size - entry.offset)
        impl->file_of(b).report_damage(size, "it is shorter than its index says");
      bucket.blocks.push_back(entry);
      bucket.checksums.push_back(in.take<std::uint32_t>());
      bucket.count += entry.count;
    }
    if (cleaned) {
      if (!take_keep(in, bucket.count, bucket.keep)) damaged(path, "is damaged: it says nothing of some samples");
      if (!bucket.keep.empty())
        bucket.count = static_cast<std::uint64_t>(std::count(bucket.keep.begin(), bucket.keep.end(), true));
    }
    impl->total += bucket.count;
  }
  if (!in.good() || in.left() != 0) damaged(path, "is damaged: it is too long");
  return SlabStore(std::move(impl));
}

}  // namespace lamina
