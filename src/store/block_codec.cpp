#include "store/block_codec.h"

#include <blosc.h>
#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <memory>

#include "lamina/error.h"

namespace lamina {
namespace {

constexpr int kLevel = 1;
constexpr const char* kCompressor = BLOSC_LZ4_COMPNAME;

/// A block begins with one of these for each column; the compressed columns follow in order.
struct ColumnHeader {
  std::uint32_t bytes = 0;  ///< compressed
  std::int32_t base = 0;    ///< positions: subtracted from every value, or the first value when they are differences
  std::uint32_t differences = 0;
};

void gather(std::span<const std::byte* const> chunks, std::size_t column_offset, std::size_t value_bytes,
            std::size_t count, std::byte* to) {
  for (const std::byte* chunk : chunks) {
    const std::size_t rows = std::min<std::size_t>(count, kChunkRows);
    std::memcpy(to, chunk + column_offset, rows * value_bytes);
    to += rows * value_bytes;
    count -= rows;
  }
}

/// Small differences of either sign become small numbers.
std::uint32_t zigzag(std::uint32_t difference) {
  return (difference << 1) ^ (0U - (difference >> 31));
}

/// Makes the high bytes of positions alike. Differences (zigzag) pay where samples come in the order of a scan line;
/// for random order they are as long as the offsets, so they must win clearly.
void flatten(std::span<std::uint32_t> values, ColumnHeader& header) {
  std::int32_t lowest = static_cast<std::int32_t>(values[0]);
  for (const auto v : values) lowest = std::min(lowest, static_cast<std::int32_t>(v));
  const auto origin = static_cast<std::uint32_t>(lowest);
  std::uint64_t offsets = 0;
  for (const auto v : values) offsets += v - origin;
  std::uint64_t differences = 0;
  for (std::size_t i = 1; i < values.size(); ++i) differences += zigzag(values[i] - values[i - 1]);
  header.differences = differences < offsets / 4 ? 1 : 0;
  if (header.differences == 0) {
    header.base = lowest;
    for (auto& v : values) v -= origin;
    return;
  }
  header.base = static_cast<std::int32_t>(values[0]);
  for (std::size_t i = values.size() - 1; i > 0; --i) values[i] = zigzag(values[i] - values[i - 1]);
  values[0] = 0;
}

void unflatten(std::span<std::uint32_t> values, const ColumnHeader& header) {
  auto base = static_cast<std::uint32_t>(header.base);
  if (header.differences == 0) {
    for (auto& v : values) v += base;
    return;
  }
  for (auto& v : values) {
    base += (v >> 1) ^ (0U - (v & 1U));
    v = base;
  }
}

/// Blosc does not look whether it gets the memory it asks for, and crashes: so does the program ask before.
void require_memory(std::size_t bytes) {
  const auto memory = std::make_unique_for_overwrite<std::byte[]>(bytes);
  *static_cast<volatile std::byte*>(memory.get()) = std::byte{};  // or the compiler leaves it all out
}

}  // namespace

std::size_t block_bound(const SampleColumns& columns, std::size_t rows) {
  return columns.size() * (sizeof(ColumnHeader) + BLOSC_MAX_OVERHEAD) + rows * columns.row_bytes();
}

std::size_t encode_block(const SampleColumns& columns, std::span<const std::byte* const> chunks, std::size_t count,
                         std::span<std::uint32_t> scratch, std::span<std::byte> block) {
  const std::size_t header_bytes = columns.size() * sizeof(ColumnHeader);
  std::size_t end = header_bytes;
  for (std::size_t c = 0; c < columns.size(); ++c) {
    const std::size_t value_bytes = columns.bytes(c);
    gather(chunks, kChunkRows * columns.bytes_before(c), value_bytes, count,
           reinterpret_cast<std::byte*>(scratch.data()));
    ColumnHeader header;
    if (SampleColumns::is_position(c)) flatten(scratch.first(count), header);
    // Given more room than this, Blosc may use it for small blocks instead of storing them plainly.
    const std::size_t room = count * value_bytes + BLOSC_MAX_OVERHEAD;
    require_memory(2 * room);
    const int bytes =
        blosc_compress_ctx(SampleColumns::is_noise(c) ? 0 : kLevel, BLOSC_SHUFFLE, value_bytes, count * value_bytes,
                           scratch.data(), block.data() + end, room, kCompressor, 0, 1);
    if (bytes <= 0) throw Error(ExitCode::internal, fmt::format("slab store: Blosc refused {} values", count));
    header.bytes = static_cast<std::uint32_t>(bytes);
    std::memcpy(block.data() + c * sizeof(ColumnHeader), &header, sizeof(header));
    end += header.bytes;
  }
  return end;
}

bool decode_block(const SampleColumns& columns, std::span<const std::byte> block, std::size_t count, LocalSamples& out,
                  std::size_t first) {
  std::size_t begin = columns.size() * sizeof(ColumnHeader);
  if (block.size() < begin) return false;
  std::vector<std::byte> scratch;
  std::vector<std::uint16_t> normals;  // the three columns after each other
  for (std::size_t c = 0; c < columns.size(); ++c) {
    ColumnHeader header;
    std::memcpy(&header, block.data() + c * sizeof(ColumnHeader), sizeof(header));
    const std::size_t bytes = count * columns.bytes(c);
    std::size_t promised = 0;
    if (header.bytes > block.size() - begin ||
        blosc_cbuffer_validate(block.data() + begin, header.bytes, &promised) != 0 || promised != bytes) {
      return false;
    }
    std::byte* to = nullptr;
    if (SampleColumns::is_normal(c)) {
      normals.resize(3 * count);
      to = reinterpret_cast<std::byte*>(normals.data() + (c - 3) * count);
    } else if (columns.is_direct(c)) {
      to = columns.data(out, c) + first * columns.bytes(c);
    } else {
      scratch.resize(bytes);
      to = scratch.data();
    }
    require_memory(2 * bytes + BLOSC_MAX_OVERHEAD);
    if (blosc_decompress_ctx(block.data() + begin, to, bytes, 1) != static_cast<int>(bytes)) return false;
    if (SampleColumns::is_position(c)) {
      unflatten({reinterpret_cast<std::uint32_t*>(to), count}, header);
    } else if (c == 5) {
      const std::uint16_t* const u = normals.data();
      unpack_normals(u, u + count, u + 2 * count, count, out.nx.data() + first, out.ny.data() + first,
                     out.nz.data() + first);
    } else if (!SampleColumns::is_normal(c) && !columns.is_direct(c)) {
      columns.convert(to, count, out, c, first);
    }
    begin += header.bytes;
  }
  return begin == block.size();
}

}  // namespace lamina
