#include "render/canvas.h"

#include <fmt/format.h>
#include <png.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

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
