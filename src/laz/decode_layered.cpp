// The layered coder: values of one kind stand together, so that those which nobody wants are skipped. The first layer,
// of coordinates and returns, tells of every point what decoders of the others have to know.
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <numeric>
#include <optional>
#include <utility>

#include "base/little_endian.h"
#include "laz/arithmetic_coder.h"
#include "laz/chunks.h"
#include "laz/core_layer.h"
#include "laz/layers.h"

namespace lamina::laz {
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
