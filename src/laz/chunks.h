// Chunks of LAZ (Martin Isenburg's LASzip): runs of points that are decoded by themselves, from a first point that
// stands as it is. Points come out as LAS keeps them, record by record.
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace lamina::laz {

/// What a chunk's records hold.
struct RecordLayout {
  std::size_t bytes = 20;       ///< of a record, extra ones at its end
  std::size_t extra_bytes = 0;  ///< of these
  bool gps_time = false;        ///< formats 1 and 3; 6 to 8 always have them
  bool colours = false;         ///< formats 2, 3, 7 and 8
  bool infrared = false;        ///< format 8
  /// Formats 6 to 8: channels of the scanner keep what is theirs apart in colours and extra bytes, too. Encoders before
  /// LASzip's fourth version took channel 0 for all points but those where the channel changes.
  bool channels_apart = false;
};

/// By byte of a record: whether anyone wants it. Layers that nobody wants are not decoded, and hold what the first
/// point has. Empty: all are wanted.
using WantedBytes = std::vector<bool>;
bool wants(const WantedBytes& wanted, std::size_t offset, std::size_t bytes);

/// Formats 0 to 3, point by point. `records` has room for the chunk's `count` records of layout.bytes each. Throws
/// Damaged.
void decode_pointwise(const RecordLayout& layout, std::span<const std::byte> chunk, std::size_t count,
                      std::byte* records);
/// Bytes of the chunk that begins the `chunk`, which may go on behind it. Throws Damaged.
std::size_t decode_unbounded(const RecordLayout& layout, std::span<const std::byte> chunk, std::size_t count,
                             std::byte* records);

/// Formats 6 to 8, layer by layer. Throws Damaged, also where the chunk holds another number of points.
void decode_layered(const RecordLayout& layout, std::span<const std::byte> chunk, const WantedBytes& wanted,
                    std::size_t count, std::byte* records);

/// Points in a layered chunk, and bytes of it, from its first bytes (layered_head_bytes() of them).
struct LayeredSize {
  std::uint64_t points = 0, bytes = 0;
};
std::size_t layered_head_bytes(const RecordLayout& layout);
LayeredSize layered_size(const RecordLayout& layout, std::span<const std::byte> head);

// The table of a LAZ file's chunks, itself compressed.

struct TabledChunk {
  std::uint32_t points = 0;  ///< 0 where all chunks but the last have the same number
  std::uint32_t bytes = 0;
};

/// The table of `chunks` entries whose code is `code`; all chunks together have at most `most_bytes`. Throws Damaged.
std::vector<TabledChunk> decode_chunk_table(std::span<const std::byte> code, std::uint32_t chunks, bool with_points,
                                            std::uint64_t most_bytes);

// Chunks, written.

/// A chunk of `count` >= 1 records of formats 6 to 8, for decode_layered().
std::vector<std::byte> encode_layered(const RecordLayout& layout, const std::byte* records, std::size_t count);

/// The code of a table of chunks, which have the same number of points but for the last.
std::vector<std::byte> encode_chunk_table(std::span<const std::uint32_t> chunk_bytes);

}  // namespace lamina::laz
