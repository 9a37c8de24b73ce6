#include "laz/chunks.h"

#include <algorithm>
#include <cstring>
#include <memory>
#include <utility>

#include "base/number.h"
#include "laz/arithmetic_coder.h"
#include "laz/core_layer.h"
#include "laz/field_codecs.h"
#include "laz/layers.h"

namespace lamina::laz {
namespace {

using Code = std::vector<std::byte>;

/// The records of a chunk, which layer after layer is made of.
class LayeredEncoder {
 public:
  LayeredEncoder(const RecordLayout& layout, const std::byte* records, std::size_t count)
      : stride_(layout.bytes), records_(records, records + layout.bytes * count), contexts_(count) {}

  Code core() {
    ArithmeticEncoder out;
    // The first point stands as it is.
    std::make_unique<CoreLayer>(first())->code(out, behind_first(), contexts_.data(), second(), stride_);
    return out.finish();
  }

  /// Of values in `bytes` at `place`. Empty where they are all the same, but for the bits that are not its own.
  template <class Values, class... Place>
  Code layer(std::size_t place, std::size_t bytes, std::byte own, const Place&... more) {
    bool changes = false;
    for (std::size_t i = 1; i < contexts_.size() && !changes; ++i) {
      for (std::size_t k = place; k < place + bytes; ++k) {
        changes = changes || ((records_[i * stride_ + k] ^ records_[k]) & own) != std::byte{};
      }
    }
    if (!changes) return {};
    ArithmeticEncoder out;
    std::make_unique<Values>(first(), more...)->code(out, contexts_.data(), behind_first(), second(), stride_);
    return out.finish();
  }

 private:
  [[nodiscard]] const std::byte* first() const { return records_.data(); }
  [[nodiscard]] std::byte* second() { return records_.data() + (behind_first() > 0 ? stride_ : 0); }
  [[nodiscard]] std::size_t behind_first() const { return contexts_.size() - 1; }

  std::size_t stride_;
  std::vector<std::byte> records_;  ///< a copy: layers put back what they find
  std::vector<PointContext> contexts_;
};

}  // namespace

std::vector<std::byte> encode_layered(const RecordLayout& layout, const std::byte* records, std::size_t count) {
  constexpr std::byte kAll{0xFF}, kNotChannel{0xCF};
  LayeredEncoder encoder(layout, records, count);
  std::vector<Code> layers;
  layers.push_back(count > 1 ? encoder.core() : Code{});
  layers.push_back(encoder.layer<HeightLayer>(8, 4, kAll));
  layers.push_back(encoder.layer<ClassLayer>(16, 1, kAll));
  layers.push_back(encoder.layer<FlagsLayer>(15, 1, kNotChannel));
  layers.push_back(encoder.layer<IntensityLayer>(12, 2, kAll));
  layers.push_back(encoder.layer<AngleLayer>(18, 2, kAll));
  layers.push_back(encoder.layer<UserLayer>(17, 1, kAll));
  layers.push_back(encoder.layer<SourceLayer>(20, 2, kAll));
  layers.push_back(encoder.layer<TimeLayer>(22, 8, kAll));
  std::size_t place = 30;
  const bool apart = layout.channels_apart;
  if (layout.colours) {
    layers.push_back(encoder.layer<ColourLayer>(place, sizeof(Colour), kAll, place, apart));
    place += sizeof(Colour);
  }
  if (layout.infrared) {
    layers.push_back(encoder.layer<InfraredLayer>(place, 2, kAll, place, apart));
    place += 2;
  }
  for (; place < layout.bytes; ++place) {
    layers.push_back(encoder.layer<ExtraByteLayer>(place, 1, kAll, place, apart));
  }

  Code chunk(records, records + layout.bytes);
  const auto append = [&](std::uint32_t value) {
    const std::size_t at = chunk.size();
    chunk.resize(at + sizeof value);
    store_little(chunk.data() + at, value);
  };
  append(static_cast<std::uint32_t>(count));
  for (const Code& layer : layers) append(static_cast<std::uint32_t>(layer.size()));
  for (const Code& layer : layers) chunk.insert(chunk.end(), layer.begin(), layer.end());
  return chunk;
}

std::vector<std::byte> encode_chunk_table(std::span<const std::uint32_t> chunk_bytes) {
  const auto codec = std::make_unique<IntegerCodec<32, 2>>();
  ArithmeticEncoder out;
  std::uint32_t last = 0;
  for (const std::uint32_t bytes : chunk_bytes) {
    codec->code(out, last, 1, bytes);
    last = bytes;
  }
  return out.finish();
}

}  // namespace lamina::laz
