// The pointwise coder: one stream of bits, in which each point has all its values behind each other.
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <numeric>
#include <optional>
#include <utility>

#include "base/number.h"
#include "laz/arithmetic_coder.h"
#include "laz/chunks.h"
#include "laz/core_layer.h"
#include "laz/field_codecs.h"
#include "laz/layers.h"

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

// The layered coder: values of one kind stand together, so that those which nobody wants are skipped. The first layer,
// of coordinates and returns, tells of every point what decoders of the others have to know.
namespace {

constexpr std::size_t kCoreBytes = 30;
constexpr std::size_t kCoreLayers = 9;

std::size_t layer_count(const RecordLayout& layout) {
  return kCoreLayers + (layout.colours ? 1 : 0) + (layout.infrared ? 1 : 0) + layout.extra_bytes;
}

/// The layers of a chunk one after another.
class Layers {
 public:
  Layers(const RecordLayout& layout, std::span<const std::byte> chunk)
      : sizes_(chunk.data() + layout.bytes + sizeof(std::uint32_t)), rest_(chunk.subspan(layered_head_bytes(layout))) {}

  std::span<const std::byte> next() {
    const auto bytes = load_little<std::uint32_t>(sizes_);
    sizes_ += sizeof bytes;
    if (bytes > rest_.size()) throw Damaged("one of its layers is cut short");
    const std::span<const std::byte> layer = rest_.first(bytes);
    rest_ = rest_.subspan(bytes);
    return layer;
  }

 private:
  const std::byte* sizes_;
  std::span<const std::byte> rest_;
};

/// A layer and its code; nothing where it is empty, which says that no value changes, or where nobody wants it.
template <class Values>
struct Layer {
  std::optional<ArithmeticDecoder> code;
  std::unique_ptr<Values> values;

  template <class... First>
  void open(std::span<const std::byte> bytes, bool wanted, const First&... first) {
    if (bytes.empty() || !wanted) return;
    code.emplace(bytes);
    values = std::make_unique<Values>(first...);
  }

  void decode(const PointContext* contexts, std::size_t count, std::byte* to, std::size_t stride) {
    if (!values) return;
    ArithmeticDecoder in_registers = *code;
    values->code(in_registers, contexts, count, to, stride);
    *code = in_registers;
  }
  void require_end() const {
    if (code && code->left() != 0) throw Damaged("one of its layers has more bytes than its points take");
  }
};

class LayeredDecoder {
 public:
  LayeredDecoder(const RecordLayout& layout, std::span<const std::byte> chunk, const WantedBytes& wanted)
      : layout_(layout), first_(chunk.data()) {
    Layers layers(layout, chunk);
    const auto is_wanted = [&](std::size_t offset, std::size_t bytes) { return wants(wanted, offset, bytes); };
    if (const auto bytes = layers.next(); !bytes.empty()) {
      core_code_ = ArithmeticDecoder(bytes);
    } else if (load_little<std::uint32_t>(first_ + layout.bytes) > 1) {
      throw Damaged("its layer of coordinates is empty");
    }
    core_ = std::make_unique<CoreLayer>(first_);
    height_.open(layers.next(), is_wanted(8, 4), first_);
    class_.open(layers.next(), is_wanted(16, 1), first_);
    flags_.open(layers.next(), is_wanted(15, 1), first_);
    intensity_.open(layers.next(), is_wanted(12, 2), first_);
    angle_.open(layers.next(), is_wanted(18, 2), first_);
    user_.open(layers.next(), is_wanted(17, 1), first_);
    source_.open(layers.next(), is_wanted(20, 2), first_);
    time_.open(layers.next(), is_wanted(22, 8), first_);
    std::size_t at = kCoreBytes;
    const bool apart = layout.channels_apart;
    if (layout.colours) {
      colour_.open(layers.next(), is_wanted(at, sizeof(Colour)), first_, at, apart);
      at += sizeof(Colour);
    }
    if (layout.infrared) {
      infrared_.open(layers.next(), is_wanted(at, 2), first_, at, apart);
      at += 2;
    }
    extra_.resize(layout.extra_bytes);
    for (auto& layer : extra_) {
      layer.open(layers.next(), is_wanted(at, 1), first_, at, apart);
      ++at;
    }
  }

  /// The next points.
  void decode(std::size_t count, std::byte* to) {
    const std::size_t stride = layout_.bytes;
    for (std::size_t i = 0; i < count; ++i) std::memcpy(to + i * stride, first_, stride);
    ArithmeticDecoder in_registers = core_code_;
    core_->code(in_registers, count, contexts_.data(), to, stride);
    core_code_ = in_registers;
    for_each([&](auto& layer) { layer.decode(contexts_.data(), count, to, stride); });
  }

  void require_end() {
    if (core_code_.left() != 0) throw Damaged("its layer of coordinates has more bytes than its points take");
    for_each([](const auto& layer) { layer.require_end(); });
  }

  static constexpr std::size_t kBlock = 512;  ///< points decoded layer by layer at once: they stay in the cache

 private:
  template <class Visit>
  void for_each(const Visit& visit) {
    visit(height_), visit(class_), visit(flags_), visit(intensity_), visit(angle_), visit(user_), visit(source_);
    visit(time_), visit(colour_), visit(infrared_);
    for (auto& layer : extra_) visit(layer);
  }

  const RecordLayout& layout_;
  const std::byte* first_;
  std::array<PointContext, kBlock> contexts_;
  ArithmeticDecoder core_code_;
  std::unique_ptr<CoreLayer> core_;
  Layer<HeightLayer> height_;
  Layer<ClassLayer> class_;
  Layer<FlagsLayer> flags_;
  Layer<IntensityLayer> intensity_;
  Layer<AngleLayer> angle_;
  Layer<UserLayer> user_;
  Layer<SourceLayer> source_;
  Layer<TimeLayer> time_;
  Layer<ColourLayer> colour_;
  Layer<InfraredLayer> infrared_;
  std::vector<Layer<ExtraByteLayer>> extra_;
};

}  // namespace

bool wants(const WantedBytes& wanted, std::size_t offset, std::size_t bytes) {
  if (wanted.empty()) return true;
  const auto begin = wanted.begin() + static_cast<std::ptrdiff_t>(offset);
  return std::find(begin, begin + static_cast<std::ptrdiff_t>(bytes), true) !=
         begin + static_cast<std::ptrdiff_t>(bytes);
}

std::size_t layered_head_bytes(const RecordLayout& layout) {
  return layout.bytes + sizeof(std::uint32_t) * (1 + layer_count(layout));
}

LayeredSize layered_size(const RecordLayout& layout, std::span<const std::byte> head) {
  const std::byte* at = head.data() + layout.bytes;
  LayeredSize size{load_little<std::uint32_t>(at), layered_head_bytes(layout)};
  for (std::size_t i = 0; i < layer_count(layout); ++i) {
    at += sizeof(std::uint32_t);
    size.bytes += load_little<std::uint32_t>(at);
  }
  return size;
}

void decode_layered(const RecordLayout& layout, std::span<const std::byte> chunk, const WantedBytes& wanted,
                    std::size_t count, std::byte* records) {
  if (chunk.size() < layered_head_bytes(layout)) throw Damaged("it is cut short");
  if (const std::uint64_t has = layered_size(layout, chunk).points; has != count) {
    throw Damaged("it says it holds another number of points than the chunk table");
  }
  const auto decoder = std::make_unique<LayeredDecoder>(layout, chunk, wanted);
  std::memcpy(records, chunk.data(), layout.bytes);
  for (std::size_t done = 1; done < count; done += LayeredDecoder::kBlock) {
    decoder->decode(std::min(LayeredDecoder::kBlock, count - done), records + done * layout.bytes);
  }
  decoder->require_end();
}

}  // namespace lamina::laz
