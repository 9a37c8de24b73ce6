#include "laz/chunk_table.h"

#include <memory>

#include "laz/arithmetic_decoder.h"
#include "laz/integer_codec.h"

namespace lamina::laz {

std::vector<TabledChunk> decode_chunk_table(std::span<const std::byte> code, std::uint32_t chunks, bool with_points,
                                            std::uint64_t most_bytes) {
  std::vector<TabledChunk> table;
  if (chunks == 0) return table;
  ArithmeticDecoder decoder(code);
  const auto integers = std::make_unique<IntegerCodec<32, 2>>();
  TabledChunk chunk;
  for (std::uint32_t i = 0; i < chunks; ++i) {
    if (with_points) chunk.points = integers->code(decoder, chunk.points, 0);
    chunk.bytes = integers->code(decoder, chunk.bytes, 1);
    // No entry without a byte in the file: the table cannot grow by its own word.
    if (chunk.bytes == 0 || chunk.bytes > most_bytes) throw Damaged("its chunk table goes beyond its chunks");
    most_bytes -= chunk.bytes;
    table.push_back(chunk);
  }
  return table;
}

}  // namespace lamina::laz
