#include "meshes/records.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <string_view>
#include <type_traits>

#include "lamina/error.h"

namespace lamina {
namespace {

static_assert(std::endian::native == std::endian::little, "records are copied as they stand in memory");

/// Vertices encoded column by column at once: the records stay in the first-level cache across the columns.
constexpr std::size_t kBlock = 256;

/// Does any of the values become infinite or NaN when written as T? Looks at the exponent bits, so that it vectorises.
template <class T, class In>
bool any_not_finite(const std::vector<In>& values) {
  using Bits = std::conditional_t<sizeof(T) == 4, std::uint32_t, std::uint64_t>;
  constexpr Bits kExponent = std::bit_cast<Bits>(std::numeric_limits<T>::infinity());
  Bits bad = 0;
  for (const In value : values) {
    const Bits bits = std::bit_cast<Bits>(static_cast<T>(value)) & kExponent;
    bad |= static_cast<Bits>(bits == kExponent);
  }
  return bad != 0;
}

template <class T, class In>
void require_finite(const std::vector<In>& values, std::string_view name, std::uint64_t first) {
  if (!any_not_finite<T>(values)) return;
  const auto at = std::find_if(values.begin(), values.end(), [](In v) { return !std::isfinite(static_cast<T>(v)); });
  throw Error(ExitCode::internal, fmt::format("vertex {} of the mesh would get {} = {}, which a mesh must not hold",
                                              first + static_cast<std::uint64_t>(at - values.begin()), name, *at));
}

/// Rounds to the nearest (ties to even) and clamps.
template <class T>
T to_type(float value) {
  if constexpr (std::is_floating_point_v<T>) {
    return static_cast<T>(value);
  } else if constexpr (sizeof(T) <= 2) {  // all values of the type are floats
    constexpr auto kLow = static_cast<float>(std::numeric_limits<T>::min());
    constexpr auto kHigh = static_cast<float>(std::numeric_limits<T>::max());
    return static_cast<T>(std::lrint(std::clamp(value, kLow, kHigh)));
  } else {
    constexpr auto kLow = static_cast<double>(std::numeric_limits<T>::min());
    constexpr auto kHigh = static_cast<double>(std::numeric_limits<T>::max());
    return static_cast<T>(std::llrint(std::clamp(static_cast<double>(value), kLow, kHigh)));
  }
}

template <class T, class In>
std::byte* put_column(const In* values, std::size_t count, std::size_t stride, std::byte* out) {
  std::byte* to = out;
  for (std::size_t i = 0; i < count; ++i, to += stride) {
    T value;
    if constexpr (std::is_same_v<In, double>) {
      value = static_cast<T>(values[i]);
    } else {
      value = to_type<T>(values[i]);
    }
    std::memcpy(to, &value, sizeof value);
  }
  return out + sizeof(T);
}

std::byte* put_attribute(ScalarType type, const float* values, std::size_t count, std::size_t stride, std::byte* out) {
  switch (type) {
    case ScalarType::int8:
      return put_column<std::int8_t>(values, count, stride, out);
    case ScalarType::uint8:
      return put_column<std::uint8_t>(values, count, stride, out);
    case ScalarType::int16:
      return put_column<std::int16_t>(values, count, stride, out);
    case ScalarType::uint16:
      return put_column<std::uint16_t>(values, count, stride, out);
    case ScalarType::int32:
      return put_column<std::int32_t>(values, count, stride, out);
    case ScalarType::uint32:
      return put_column<std::uint32_t>(values, count, stride, out);
    case ScalarType::float32:
      return put_column<float>(values, count, stride, out);
    case ScalarType::float64:
      break;
  }
  return put_column<double>(values, count, stride, out);
}

}  // namespace

std::size_t vertex_record_bytes(const AttributeLayout& attributes, bool double_positions) {
  std::size_t bytes = 3 * (double_positions ? sizeof(double) : sizeof(float)) + 3 * sizeof(float);
  for (const AttributeSpec& attribute : attributes) bytes += static_cast<std::size_t>(byte_size(attribute.type));
  return bytes;
}

void require_writable(const VertexBatch& batch, const AttributeLayout& attributes, bool double_positions,
                      std::uint64_t first) {
  const std::size_t n = batch.size();
  bool even = batch.attributes.size() == attributes.size();
  for (const auto* axis : {&batch.y, &batch.z}) even = even && axis->size() == n;
  for (const auto* normal : {&batch.nx, &batch.ny, &batch.nz}) even = even && normal->size() == n;
  for (const auto& attribute : batch.attributes) even = even && attribute.size() == n;
  if (!even) throw Error(ExitCode::internal, "the arrays of a batch of vertices differ in length");

  const auto position = [&](const std::vector<double>& values, std::string_view name) {
    double_positions ? require_finite<double>(values, name, first) : require_finite<float>(values, name, first);
  };
  position(batch.x, "x");
  position(batch.y, "y");
  position(batch.z, "z");
  require_finite<float>(batch.nx, "nx", first);
  require_finite<float>(batch.ny, "ny", first);
  require_finite<float>(batch.nz, "nz", first);
  for (std::size_t a = 0; a < attributes.size(); ++a) {
    require_finite<float>(batch.attributes[a], attributes[a].name, first);
  }
}

void encode_vertices(const VertexBatch& batch, const AttributeLayout& attributes, bool double_positions,
                     std::size_t first, std::size_t count, std::byte* out) {
  const std::size_t stride = vertex_record_bytes(attributes, double_positions);
  for (std::size_t done = 0; done < count; done += kBlock) {
    const std::size_t n = std::min(kBlock, count - done);
    const std::size_t at = first + done;
    std::byte* to = out + done * stride;
    for (const auto* axis : {&batch.x, &batch.y, &batch.z}) {
      to = double_positions ? put_column<double>(axis->data() + at, n, stride, to)
                            : put_column<float>(axis->data() + at, n, stride, to);
    }
    for (const auto* normal : {&batch.nx, &batch.ny, &batch.nz}) {
      to = put_column<float>(normal->data() + at, n, stride, to);
    }
    for (std::size_t a = 0; a < attributes.size(); ++a) {
      to = put_attribute(attributes[a].type, batch.attributes[a].data() + at, n, stride, to);
    }
  }
}

std::uint32_t encode_faces(const std::array<std::uint32_t, 3>* triangles, std::size_t count, std::byte* out) {
  std::uint32_t largest = 0;
  for (std::size_t i = 0; i < count; ++i, out += kFaceRecordBytes) {
    const auto& triangle = triangles[i];
    out[0] = std::byte{3};
    std::memcpy(out + 1, triangle.data(), sizeof triangle);
    largest = std::max({largest, triangle[0], triangle[1], triangle[2]});
  }
  return largest;
}

}  // namespace lamina
