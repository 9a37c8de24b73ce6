#include "render/canvas.h"

#include <fmt/format.h>
#include <png.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "base/output_file.h"
#include "lamina/error.h"
#include "lamina/render.h"

namespace lamina::render_detail {
namespace {

constexpr std::size_t kEncodeSteps = 8192;  // finer than eight bits even at the curve's steep dark end

struct Tables {
  std::array<std::uint8_t, kEncodeSteps + 1> encode{};
  std::array<float, 256> decode{};
  Tables() {
    for (std::size_t i = 0; i <= kEncodeSteps; ++i) {
      const double v = static_cast<double>(i) / kEncodeSteps;
      const double s = v <= 0.0031308 ? 12.92 * v : 1.055 * std::pow(v, 1 / 2.4) - 0.055;
      encode[i] = static_cast<std::uint8_t>(std::lround(255 * s));
    }
    for (std::size_t i = 0; i < decode.size(); ++i) {
      const double s = static_cast<double>(i) / 255;
      decode[i] = static_cast<float>(s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4));
    }
  }
};

const Tables& tables() {
  static const Tables made;
  return made;
}

constexpr Rgb kBackground{0.92F, 0.93F, 0.95F};

}  // namespace

std::uint8_t encode(float linear) {
  return tables().encode[static_cast<std::size_t>(std::lround(std::clamp(linear, 0.0F, 1.0F) * kEncodeSteps))];
}

float decode(std::uint8_t encoded) {
  return tables().decode[encoded];
}

float decode(float byte) {
  return decode(static_cast<std::uint8_t>(byte > 0 ? std::min(byte, 255.0F) + 0.5F : 0.0F));
}

void Canvas::blend(int x, int y, float depth, const Rgb& light, float opacity) {
  const auto& before = colour_[index(x, y)];
  Rgb mixed;
  for (std::size_t c = 0; c < 3; ++c)
    mixed[c] = light[c] + (1 - opacity) * (before[3] != 0 ? decode(before[c]) : kBackground[c]);
  set(x, y, depth, mixed);
}

bool Canvas::blank() const {
  return std::none_of(colour_.begin(), colour_.end(), [](const auto& sample) { return sample[3] != 0; });
}

Image Canvas::resolve(int supersample) const {
  Image image{width_ / supersample, height_ / supersample, {}};
  const auto row_bytes = 3 * static_cast<std::size_t>(image.width);
  image.pixels.resize(row_bytes * static_cast<std::size_t>(image.height));
  const float share = 1.0F / static_cast<float>(supersample * supersample);
  tbb::parallel_for(0, image.height, [&](int y) {
    std::uint8_t* out = image.pixels.data() + static_cast<std::size_t>(y) * row_bytes;
    for (int x = 0; x < image.width; ++x) {
      Rgb sum{};
      for (int sy = 0; sy < supersample; ++sy) {
        for (int sx = 0; sx < supersample; ++sx) {
          const auto& sample = colour_[index(x * supersample + sx, y * supersample + sy)];
          for (std::size_t c = 0; c < 3; ++c) sum[c] += sample[3] != 0 ? decode(sample[c]) : kBackground[c];
        }
      }
      for (std::size_t c = 0; c < 3; ++c) *out++ = encode(sum[c] * share);
    }
  });
  return image;
}

}  // namespace lamina::render_detail

namespace lamina {

std::array<std::uint8_t, 3> Image::at(int x, int y) const {
  const auto i = 3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x));
  return {pixels[i], pixels[i + 1], pixels[i + 2]};
}

void write_png(const Image& image, const std::string& path) {
  png_image header = {};
  header.version = PNG_IMAGE_VERSION;
  header.width = static_cast<png_uint_32>(image.width);
  header.height = static_cast<png_uint_32>(image.height);
  header.format = PNG_FORMAT_RGB;
  // Encoded in memory: libpng's own file writer would leave half a file under the final name.
  std::string bytes(PNG_IMAGE_PNG_SIZE_MAX(header), '\0');
  png_alloc_size_t size = bytes.size();
  if (png_image_write_to_memory(&header, bytes.data(), &size, 0, image.pixels.data(), 0, nullptr) == 0) {
    throw Error(ExitCode::internal, fmt::format("{}: the picture cannot be encoded: {}", path, header.message));
  }
  bytes.resize(size);
  ResultFile file(path);
  file.write(bytes);
  file.commit();
}

}  // namespace lamina

namespace lamina::render_detail {
namespace {

constexpr Rgb kBackTint{0.10F, 0.16F, 0.38F};

// The factor that brings a channel of this type to 0-255.
float byte_scale(ScalarType type) {
  switch (type) {
    case ScalarType::int8:
    case ScalarType::uint8:
      return 1;
    case ScalarType::int16:
    case ScalarType::uint16:
    case ScalarType::int32:
    case ScalarType::uint32:
      return 255.0F / 65535.0F;
    case ScalarType::float32:
    case ScalarType::float64:
      break;
  }
  return 255;
}

}  // namespace

Rgb lit(const Rgb& base, const Eigen::Vector3f& normal, bool back_face) {
  static const Eigen::Vector3f key = Eigen::Vector3f(-0.48F, 0.58F, 0.66F).normalized();
  static const Eigen::Vector3f fill = Eigen::Vector3f(0.65F, -0.15F, 0.74F).normalized();
  static const Eigen::Vector3f half = (key + Eigen::Vector3f::UnitZ()).normalized();
  const float sky = 0.5F + 0.5F * normal.y();
  const float light =
      0.05F + 0.12F * sky + 0.88F * std::max(0.0F, key.dot(normal)) + 0.14F * std::max(0.0F, fill.dot(normal));
  float shine = std::max(0.0F, half.dot(normal));
  for (int i = 0; i < 5; ++i) shine *= shine;
  const float graze = 1 - std::clamp(normal.z(), 0.0F, 1.0F);
  const float extra = back_face ? 0.0F : 0.05F * shine + 0.10F * graze * graze * graze;
  Rgb out;
  for (std::size_t c = 0; c < 3; ++c) {
    const float body = back_face ? 0.35F * base[c] + 0.65F * kBackTint[c] : base[c];
    out[c] = body * light + extra;
  }
  return out;
}

Rgb normal_colour(const std::array<float, 3>& normal) {
  const float length = std::hypot(normal[0], normal[1], normal[2]);
  if (!(length > 0)) return kClay;
  Rgb out;
  for (std::size_t c = 0; c < 3; ++c) out[c] = 0.5F + 0.5F * normal[c] / length;
  return out;
}

std::optional<ColourReader> ColourReader::find(const AttributeLayout& layout,
                                               const std::vector<std::vector<float>>& values) {
  static constexpr std::array<const char*, 3> kNames{"red", "green", "blue"};
  ColourReader reader;
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t a = 0; a < layout.size() && a < values.size(); ++a) {
      if (layout[a].name != kNames[c]) continue;
      reader.channels_[c] = &values[a];
      reader.to_byte_[c] = byte_scale(layout[a].type);
    }
    if (reader.channels_[c] == nullptr) return std::nullopt;
  }
  return reader;
}

Rgb ColourReader::operator()(std::size_t i) const {
  Rgb out;
  for (std::size_t c = 0; c < 3; ++c) {
    out[c] = decode(to_byte_[c] * (*channels_[c])[i]);
  }
  return out;
}

}  // namespace lamina::render_detail
