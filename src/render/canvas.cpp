#include "render/canvas.h"

#include <fmt/format.h>
#include <png.h>
#include <tbb/parallel_for.h>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "base/output_file.h"
#include "lamina/error.h"
#include "lamina/render.h"

namespace lamina::render_detail {
namespace {

constexpr double kMargin = 0.94;      // share of a tile that the model may fill
constexpr int kMostFramedTurns = 24;  // between two of them a model reaches less than the margin further out

void aim(const RenderSettings& settings, double azimuth, View& view) {
  const Eigen::Vector3d up = Eigen::Vector3d::Unit(settings.up);
  const Eigen::Vector3d front =
      settings.up == 2 ? Eigen::Vector3d(-Eigen::Vector3d::UnitY()) : Eigen::Vector3d::UnitZ();
  const double a = azimuth * std::numbers::pi / 180, e = settings.elevation * std::numbers::pi / 180;
  const Eigen::Vector3d level = std::cos(a) * front + std::sin(a) * up.cross(front);
  view.toward = (std::cos(e) * level + std::sin(e) * up).normalized();
  view.right = up.cross(level).normalized();
  view.up = view.toward.cross(view.right);
}

}  // namespace

void Extent::add(const View& view, const std::array<double, 3>& p) {
  const Eigen::Vector3d v(p[0], p[1], p[2]);
  const Eigen::Vector3d along(view.right.dot(v), view.up.dot(v), view.toward.dot(v));
  low_ = low_.cwiseMin(along);
  high_ = high_.cwiseMax(along);
}

Eigen::Vector3d Extent::middle(const View& view) const {
  if (empty()) return Eigen::Vector3d::Zero();
  const Eigen::Vector3d m = 0.5 * (low_ + high_);
  return m[0] * view.right + m[1] * view.up + m[2] * view.toward;
}

std::vector<View> make_views(const RenderSettings& settings, double turned) {
  std::vector<View> views(static_cast<std::size_t>(settings.views));
  const int columns = static_cast<int>(std::ceil(std::sqrt(settings.views)));
  const int rows = (settings.views + columns - 1) / columns;
  const int width = settings.width * settings.supersample, height = settings.height * settings.supersample;
  for (int i = 0; i < settings.views; ++i) {
    View& view = views[static_cast<std::size_t>(i)];
    aim(settings, settings.azimuth + turned + 360.0 * i / settings.views, view);
    const int column = i % columns, row = i / columns;
    view.tile.x = column * width / columns;
    view.tile.y = row * height / rows;
    view.tile.width = (column + 1) * width / columns - view.tile.x;
    view.tile.height = (row + 1) * height / rows - view.tile.y;
  }
  return views;
}

std::vector<View> framing_views(const RenderSettings& settings) {
  std::vector<View> views;
  const int turns = std::min(settings.frames, kMostFramedTurns);
  for (int i = 0; i < turns; ++i) {
    const std::vector<View> more = make_views(settings, 360.0 * i / turns);
    views.insert(views.end(), more.begin(), more.end());
  }
  return views;
}

void fit_views(const RenderSettings& settings, const std::vector<View>& framing, const std::vector<Extent>& extents,
               std::vector<View>& views) {
  double scale = std::numeric_limits<double>::infinity();
  const auto fits = [&](double samples, double size) {
    if (size > 0) scale = std::min(scale, kMargin * samples / size);
  };
  if (settings.frames > 1 && !settings.zoom) {
    // One centre on the axis of the turn, so that nothing sways.
    const Eigen::Vector3d centre = extents[0].middle(framing[0]);
    for (std::size_t i = 0; i < framing.size(); ++i) {
      fits(framing[i].tile.width, 2 * extents[i].reach(0, framing[i].right.dot(centre)));
      fits(framing[i].tile.height, 2 * extents[i].reach(1, framing[i].up.dot(centre)));
    }
    for (View& view : views) {
      view.centre = centre;
      view.scale = std::isfinite(scale) ? scale : 1;
    }
    return;
  }
  for (std::size_t i = 0; i < views.size(); ++i) {
    View& view = views[i];
    if (settings.zoom) {
      const auto& c = settings.zoom->centre;
      view.centre = {c[0], c[1], c[2]};
      view.near = static_cast<float>(settings.zoom->radius);
      scale = std::min(scale, std::min(view.tile.width, view.tile.height) / (2 * settings.zoom->radius));
    } else {
      view.centre = extents[i].middle(view);
      fits(view.tile.width, extents[i].size(0));
      fits(view.tile.height, extents[i].size(1));
    }
  }
  for (View& view : views) view.scale = std::isfinite(scale) ? scale : 1;
}

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
