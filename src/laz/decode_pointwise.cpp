// The pointwise coder: one stream of bits, in which each point has all its values behind each other.
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <optional>

#include "base/little_endian.h"
#include "laz/arithmetic_coder.h"
#include "laz/chunks.h"
#include "laz/field_codecs.h"
#include "laz/point_contexts.h"

namespace lamina::laz {
namespace {

/// The 20 bytes that all of formats 0 to 3 have.
class CorePointDecoder {
 public:
  static constexpr std::size_t kBytes = 20;

  explicit CorePointDecoder(const std::byte* first) {
    std::memcpy(last_.data(), first, kBytes);
    for (std::size_t k = 0; k < 3; ++k) position_[k] = load_little<std::uint32_t>(first + 4 * k);
    source_ = load_little<std::uint16_t>(first + kSource);
  }

  void decode(ArithmeticDecoder& code, std::byte* to) {
    const unsigned changed = code.symbol(changed_);
    if ((changed & 32) != 0) last_[kReturns] = byte(code.symbol(returns_[at(kReturns)]));
    const unsigned r = at(kReturns) & 7;
    const unsigned n = at(kReturns) >> 3 & 7;
    const unsigned context = kOldReturnContext[n][r];
    if ((changed & 16) != 0) {
      const unsigned model = context < 3 ? context : 3;
      intensities_[context] = static_cast<std::uint16_t>(intensity_.code(code, intensities_[context], model));
    }
    if ((changed & 8) != 0) last_[kClass] = byte(code.symbol(classes_[at(kClass)]));
    if ((changed & 4) != 0) last_[kAngle] = byte(code.symbol(angles_[at(kReturns) >> 6 & 1]) + at(kAngle));
    if ((changed & 2) != 0) last_[kUser] = byte(code.symbol(users_[at(kUser)]));
    if ((changed & 1) != 0) source_ = static_cast<std::uint16_t>(sources_.code(code, source_, 0));
    decode_position(code, context, n, return_level(n, r));
    std::memcpy(to, last_.data(), kBytes);
    for (std::size_t k = 0; k < 3; ++k) store_little(to + 4 * k, position_[k]);
    store_little(to + kIntensity, intensities_[context]);
    store_little(to + kSource, source_);
  }

 private:
  static constexpr std::size_t kIntensity = 12, kReturns = 14, kClass = 15, kAngle = 16, kUser = 17, kSource = 18;

  [[nodiscard]] unsigned at(std::size_t place) const { return std::to_integer<unsigned>(last_[place]); }
  static std::byte byte(unsigned value) { return static_cast<std::byte>(value); }

  void decode_position(ArithmeticDecoder& code, unsigned context, unsigned n, unsigned level) {
    const unsigned single = n == 1 ? 1 : 0;
    const std::uint32_t x_step = x_.code(code, x_steps_[context].get(), single);
    position_[0] += x_step;
    x_steps_[context].add(x_step);
    const std::uint32_t y_step = y_.code(code, y_steps_[context].get(), single + magnitude_context(x_.magnitude(), 20));
    position_[1] += y_step;
    y_steps_[context].add(y_step);
    const unsigned magnitude = (x_.magnitude() + y_.magnitude()) / 2;
    position_[2] = heights_[level] = z_.code(code, heights_[level], single + magnitude_context(magnitude, 18));
  }

  std::array<std::byte, kBytes> last_{};
  std::array<std::uint32_t, 3> position_{};
  std::uint16_t source_ = 0;
  std::array<std::uint16_t, 16> intensities_{};  ///< the last ones by return; 0 at first, whatever the first point has
  std::array<RunningMedian, 16> x_steps_, y_steps_;
  std::array<std::uint32_t, 8> heights_{};
  SymbolModel<64> changed_;
  ModelBank<256, 256> returns_, classes_, users_;
  std::array<SymbolModel<256>, 2> angles_;
  IntegerCodec<16, 4> intensity_;
  IntegerCodec<16, 1> sources_;
  IntegerCodec<32, 2> x_;
  IntegerCodec<32, 22> y_;
  IntegerCodec<32, 20> z_;
};

struct PointwiseDecoder {
  PointwiseDecoder(const RecordLayout& layout, const std::byte* first) : core(first) {
    std::size_t at = CorePointDecoder::kBytes;
    if (layout.gps_time) {
      time.emplace(load_little<std::uint64_t>(first + at));
      at += sizeof(std::uint64_t);
    }
    if (layout.colours) {
      colour.emplace();
      last_colour = load_little<Colour>(first + at);
      at += sizeof(Colour);
    }
    last_extra.assign(first + at, first + at + layout.extra_bytes);
    extra.resize(layout.extra_bytes);
  }

  void decode(ArithmeticDecoder& code, std::byte* to) {
    core.decode(code, to);
    to += CorePointDecoder::kBytes;
    if (time) to = store_little(to, time->code(code));
    if (colour) {
      last_colour = colour->code(code, last_colour);
      to = store_little(to, last_colour);
    }
    for (std::size_t i = 0; i < extra.size(); ++i) {
      last_extra[i] = static_cast<std::byte>(std::to_integer<unsigned>(last_extra[i]) + code.symbol(extra[i]));
      *to++ = last_extra[i];
    }
  }

  CorePointDecoder core;
  std::optional<GpsTimeCodec<true>> time;
  std::optional<ColourCodec> colour;
  Colour last_colour{};
  std::vector<SymbolModel<256>> extra;
  std::vector<std::byte> last_extra;
};

}  // namespace

std::size_t decode_unbounded(const RecordLayout& layout, std::span<const std::byte> chunk, std::size_t count,
                             std::byte* records) {
  if (chunk.size() < layout.bytes) throw Damaged("its first point is cut short");
  std::memcpy(records, chunk.data(), layout.bytes);
  const auto decoder = std::make_unique<PointwiseDecoder>(layout, chunk.data());
  ArithmeticDecoder code(chunk.subspan(layout.bytes));
  for (std::size_t i = 1; i < count; ++i) decoder->decode(code, records + i * layout.bytes);
  return chunk.size() - code.left();
}

void decode_pointwise(const RecordLayout& layout, std::span<const std::byte> chunk, std::size_t count,
                      std::byte* records) {
  if (decode_unbounded(layout, chunk, count, records) != chunk.size()) {
    throw Damaged("its points take fewer bytes than it has");
  }
}

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
