// One block of the store: a run of a bucket's samples, each column compressed on its own.
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>

#include "store/columns.h"

namespace lamina {

/// Where a block lies in the file.
struct BlockEntry {
  std::uint64_t offset = 0;
  std::uint32_t bytes = 0;
  std::uint32_t count = 0;  ///< samples
};

/// Most samples in one block: bounds the scratch memory and leaves work for several threads in one bucket.
inline constexpr std::size_t kBlockRows = 16384;

/// Room a block of `rows` rows can need.
[[nodiscard]] std::size_t block_bound(const SampleColumns& columns, std::size_t rows);

/// Compresses `count` rows lying in `chunks` in order, each chunk full but the last, into `block` (block_bound(count)
/// bytes) and returns the bytes used: a function of the rows alone. `scratch` holds `count` values.
std::size_t encode_block(const SampleColumns& columns, std::span<const std::byte* const> chunks, std::size_t count,
                         std::span<std::uint32_t> scratch, std::span<std::byte> block);

/// Decompresses a block of `count` rows into rows [first, first + count) of `out`, which has been sized for them.
/// Distinct rows may be decoded from several threads. False when the bytes are not such a block.
[[nodiscard]] bool decode_block(const SampleColumns& columns, std::span<const std::byte> block, std::size_t count,
                                LocalSamples& out, std::size_t first);

}  // namespace lamina
