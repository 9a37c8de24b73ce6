#include "laz/encode_chunk.h"

#include <algorithm>
#include <array>
#include <memory>
#include <utility>

#include "base/little_endian.h"
#include "laz/arithmetic_encoder.h"
#include "laz/colour_codec.h"
#include "laz/integer_codec.h"
#include "laz/layer_decoders.h"
#include "laz/return_contexts.h"
#include "laz/running_median.h"

namespace lamina::laz {
namespace {

using Code = std::vector<std::byte>;

/// Records one after another.
struct RecordRun {
  const std::byte* first;
  std::size_t bytes, count;

  template <class T>
  [[nodiscard]] T value(std::size_t record, std::size_t place) const {
    return load_little<T>(first + record * bytes + place);
  }
};

/// Contexts of points that are the only returns of their pulses.
constexpr unsigned kOnly = 1;  ///< number of returns, and return number

/// The first two layers: x and y; z, whose contexts depend on them.
std::array<Code, 2> encode_places(const RecordRun& records) {
  struct Models {
    SymbolModel<128> changed;
    IntegerCodec<32, 2> x;
    IntegerCodec<32, 22> y;
    IntegerCodec<32, 20> z;
  };
  const auto models = std::make_unique<Models>();
  RunningMedian x_steps, y_steps;
  ArithmeticEncoder places, heights;
  std::array<std::uint32_t, 3> last{records.value<std::uint32_t>(0, 0), records.value<std::uint32_t>(0, 4),
                                    records.value<std::uint32_t>(0, 8)};
  bool flat = true;
  for (std::size_t i = 1; i < records.count; ++i) {
    const std::array<std::uint32_t, 3> here{records.value<std::uint32_t>(i, 0), records.value<std::uint32_t>(i, 4),
                                            records.value<std::uint32_t>(i, 8)};
    places.symbol(models->changed, 0);
    const std::uint32_t x_step = here[0] - last[0];
    models->x.code(places, x_steps.get(), kOnly, x_step);
    x_steps.add(x_step);
    const std::uint32_t y_step = here[1] - last[1];
    models->y.code(places, y_steps.get(), kOnly + magnitude_context(models->x.magnitude(), 20), y_step);
    y_steps.add(y_step);
    const unsigned magnitude = (models->x.magnitude() + models->y.magnitude()) / 2;
    models->z.code(heights, last[2], kOnly + magnitude_context(magnitude, 18), here[2]);
    flat = flat && here[2] == last[2];
    last = here;
  }
  return {places.finish(), flat ? Code{} : heights.finish()};
}

/// A layer is empty where all its values are the same.
template <class T>
bool all_same(const RecordRun& records, std::size_t place) {
  for (std::size_t i = 1; i < records.count; ++i) {
    if (records.value<T>(i, place) != records.value<T>(0, place)) return false;
  }
  return true;
}

Code encode_intensity(const RecordRun& records) {
  constexpr std::size_t kPlace = 12;
  if (all_same<std::uint16_t>(records, kPlace)) return {};
  const auto codec = std::make_unique<IntegerCodec<16, 4>>();
  ArithmeticEncoder out;
  for (std::size_t i = 1; i < records.count; ++i) {
    codec->code(out, records.value<std::uint16_t>(i - 1, kPlace), PointContext::kSingle,
                records.value<std::uint16_t>(i, kPlace));
  }
  return out.finish();
}

/// Values that are predicted from the last point's alone.
template <class Codec, class T>
Code encode_values(const RecordRun& records, std::size_t place) {
  if (all_same<T>(records, place)) return {};
  const auto codec = std::make_unique<Codec>();
  ArithmeticEncoder out;
  for (std::size_t i = 1; i < records.count; ++i) {
    codec->code(out, records.value<T>(i - 1, place), records.value<T>(i, place));
  }
  return out.finish();
}

}  // namespace

std::vector<std::byte> encode_layered(const RecordLayout& layout, const std::byte* records, std::size_t count) {
  const RecordRun run{records, layout.bytes, count};
  std::vector<Code> layers;
  if (count > 1) {
    for (Code& layer : encode_places(run)) layers.push_back(std::move(layer));
  } else {
    layers.resize(2);
  }
  constexpr std::size_t kUnchanged = 2;  // classes and flags before the intensity, angles to times behind it
  layers.resize(layers.size() + kUnchanged);
  layers.push_back(encode_intensity(run));
  constexpr std::size_t kUnchangedBehind = 4;
  layers.resize(layers.size() + kUnchangedBehind);
  std::size_t place = layout.bytes - layout.extra_bytes;
  if (layout.colours) layers.push_back(encode_values<ColourCodec, Colour>(run, place - sizeof(Colour)));
  for (; place < layout.bytes; ++place) layers.push_back(encode_values<ExtraByteCodec, std::uint8_t>(run, place));

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
