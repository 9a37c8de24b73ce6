#include "points/row_codec.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <string_view>
#include <type_traits>

#include "lamina/error.h"
#include "points/ply_columns.h"

namespace lamina {
namespace {

static_assert(std::endian::native == std::endian::little, "rows are copied as they stand in memory");

/// Rows encoded column by column at once: they stay in the first-level cache across the columns.
constexpr std::size_t kBlock = 256;

template <class T, class In>
T to_type(In value) {
  if constexpr (std::is_floating_point_v<T>) {
    return static_cast<T>(value);
  } else {
    constexpr auto kLow = static_cast<double>(std::numeric_limits<T>::min());
    constexpr auto kHigh = static_cast<double>(std::numeric_limits<T>::max());
    return static_cast<T>(std::llrint(std::clamp(static_cast<double>(value), kLow, kHigh)));
  }
}

/// Calls use(zero of the type).
template <class Use>
auto with_type(ScalarType type, Use use) {
  switch (type) {
    case ScalarType::int8:
      return use(std::int8_t{});
    case ScalarType::uint8:
      return use(std::uint8_t{});
    case ScalarType::int16:
      return use(std::int16_t{});
    case ScalarType::uint16:
      return use(std::uint16_t{});
    case ScalarType::int32:
      return use(std::int32_t{});
    case ScalarType::uint32:
      return use(std::uint32_t{});
    case ScalarType::float32:
      return use(float{});
    case ScalarType::float64:
      break;
  }
  return use(double{});
}

template <class In>
bool fits(ScalarType type, In value) {
  const bool narrow = type == ScalarType::float32;
  return narrow ? std::isfinite(static_cast<float>(value)) : std::isfinite(value);
}

/// Calls visit(name, type, values) for every column in the order of the rows.
template <class Batch, class Visit>
void for_each_column(const PointColumns& columns, Batch& batch, const Visit& visit) {
  const ScalarType position = columns.double_positions ? ScalarType::float64 : ScalarType::float32;
  visit("x", position, batch.x);
  visit("y", position, batch.y);
  visit("z", position, batch.z);
  if (columns.normals) {
    visit("nx", ScalarType::float32, batch.nx);
    visit("ny", ScalarType::float32, batch.ny);
    visit("nz", ScalarType::float32, batch.nz);
  }
  if (!columns.radius.empty()) visit(columns.radius, ScalarType::float32, batch.radius);
  if (!columns.quality.empty()) visit(columns.quality, ScalarType::float32, batch.quality);
  for (std::size_t a = 0; a < columns.attributes.size(); ++a) {
    const AttributeSpec& spec = columns.attributes[a];
    if (a < batch.exact.size() && !batch.exact[a].empty()) {
      visit(spec.name, spec.type, batch.exact[a]);
    } else {
      visit(spec.name, spec.type, batch.attributes[a]);
    }
  }
}

}  // namespace

RowCodec::RowCodec(const PointColumns& columns) : columns_(columns) {
  row_bytes_ = 3 * (columns.double_positions ? sizeof(double) : sizeof(float));
  if (columns.normals) row_bytes_ += 3 * sizeof(float);
  if (!columns.radius.empty()) row_bytes_ += sizeof(float);
  if (!columns.quality.empty()) row_bytes_ += sizeof(float);
  for (const AttributeSpec& spec : columns.attributes) row_bytes_ += static_cast<std::size_t>(byte_size(spec.type));
}

void RowCodec::require_writable(const SampleBatch& batch, std::uint64_t first, const std::string& name) const {
  if (batch.attributes.size() != columns_.attributes.size()) {
    throw Error(ExitCode::internal, fmt::format("{}: rows of {} attributes came, {} were announced", name,
                                                batch.attributes.size(), columns_.attributes.size()));
  }
  for_each_column(columns_, batch, [&](std::string_view column, ScalarType type, const auto& values) {
    if (values.size() != batch.size()) {
      throw Error(ExitCode::internal, fmt::format("{}: {} of {} rows have a value '{}' from row {} on", name,
                                                  values.size(), batch.size(), column, first));
    }
    const auto bad = std::find_if(values.begin(), values.end(), [&](auto v) { return !fits(type, v); });
    if (bad != values.end()) {
      throw Error(ExitCode::internal,
                  fmt::format("{}: row {} would get {} = {}, which must not be written", name,
                              first + static_cast<std::uint64_t>(bad - values.begin()), column, *bad));
    }
  });
}

void RowCodec::encode(const SampleBatch& batch, std::size_t first, std::size_t count, std::byte* out) const {
  for (std::size_t done = 0; done < count; done += kBlock) {
    const std::size_t n = std::min(kBlock, count - done);
    std::byte* column_start = out + done * row_bytes_;
    for_each_column(columns_, batch, [&](std::string_view, ScalarType type, const auto& values) {
      with_type(type, [&](auto zero) {
        using T = decltype(zero);
        std::byte* to = column_start;
        for (std::size_t i = first + done; i < first + done + n; ++i, to += row_bytes_) {
          const T value = to_type<T>(values[i]);
          std::memcpy(to, &value, sizeof value);
        }
        column_start += sizeof(T);
      });
    });
  }
}

void RowCodec::decode(const std::byte* rows, std::size_t stride, std::size_t count, SampleBatch& out) const {
  const AttributeLayout& layout = columns_.attributes;
  out.attributes.resize(layout.size());
  out.exact.resize(layout.size());
  for (std::size_t a = 0; a < layout.size(); ++a) out.exact[a].resize(fits_float(layout[a].type) ? 0 : count);
  const std::byte* from = rows;
  for_each_column(columns_, out, [&](std::string_view, ScalarType type, auto& values) {
    values.resize(count);
    convert_column(type, false, from, stride, count, values.data());
    from += byte_size(type);
  });
  if (!columns_.normals) out.nx.clear(), out.ny.clear(), out.nz.clear();
  if (columns_.radius.empty()) out.radius.clear();
  if (columns_.quality.empty()) out.quality.clear();
  for (std::size_t a = 0; a < layout.size(); ++a) {
    if (fits_float(layout[a].type)) continue;
    out.attributes[a].assign(out.exact[a].begin(), out.exact[a].end());
  }
}

}  // namespace lamina
