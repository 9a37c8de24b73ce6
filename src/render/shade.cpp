#include "render/shade.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

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
