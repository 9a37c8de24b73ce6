#include "store/columns.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <type_traits>

#include "base/resize_anew.h"
#include "lamina/error.h"

namespace lamina {
namespace {

template <class T>
T to_rest(float value) {
  if constexpr (std::is_floating_point_v<T>) {
    return value;
  } else {
    if (std::isnan(value)) return 0;
    constexpr double lowest = std::numeric_limits<T>::lowest();
    constexpr double highest = std::numeric_limits<T>::max();
    const double rounded_up = std::clamp(static_cast<double>(value) + 0.5, lowest, highest);
    const auto truncated = static_cast<T>(rounded_up);
    return static_cast<T>(truncated - static_cast<T>(static_cast<double>(truncated) > rounded_up));
  }
}

/// Calls f with a value of the C++ type a column rests in. float64 rests as float: what comes in is a float.
template <class F>
void with_type(ScalarType type, F&& f) {
  switch (type) {
    case ScalarType::int8:
      return f(std::int8_t{});
    case ScalarType::uint8:
      return f(std::uint8_t{});
    case ScalarType::int16:
      return f(std::int16_t{});
    case ScalarType::uint16:
      return f(std::uint16_t{});
    case ScalarType::int32:
      return f(std::int32_t{});
    case ScalarType::uint32:
      return f(std::uint32_t{});
    case ScalarType::float32:
    case ScalarType::float64:
      return f(float{});
  }
}

constexpr std::array kPositions{&LocalSamples::x, &LocalSamples::y, &LocalSamples::z};
constexpr std::array kNormals{&LocalSamples::nx, &LocalSamples::ny, &LocalSamples::nz};
constexpr std::array kPacked{&PackedNormals::u, &PackedNormals::v, &PackedNormals::low};

/// Writes make(values[rows[i]]) to its slot; `column` points at the column's values in the first chunk.
template <class T, class Make>
void scatter_values(const T* values, std::span<const std::uint32_t> rows, std::span<const std::uint32_t> slots,
                    std::byte* column, std::size_t chunk_bytes, Make&& make) {
  for (std::size_t i = 0; i < slots.size(); ++i) {
    const auto value = make(values[rows[i]]);
    const std::size_t chunk = slots[i] / kChunkRows;
    const std::size_t row = slots[i] % kChunkRows;
    std::memcpy(column + chunk * chunk_bytes + row * sizeof(value), &value, sizeof(value));
  }
}

}  // namespace

SampleColumns::SampleColumns(const StoreLayout& layout)
    : has_radius_(layout.has_radius), has_quality_(layout.has_quality) {
  types_.assign(3, ScalarType::int32);
  types_.insert(types_.end(), 3, ScalarType::uint16);
  for (const bool present : {has_radius_, has_quality_}) {
    if (present) types_.push_back(ScalarType::float32);
  }
  first_attribute_ = types_.size();
  for (const auto& attribute : layout.attributes) {
    types_.push_back(attribute.type == ScalarType::float64 ? ScalarType::float32 : attribute.type);
  }
  bytes_before_.push_back(0);
  for (std::size_t c = 0; c < types_.size(); ++c) bytes_before_.push_back(bytes_before_.back() + bytes(c));
}

const std::vector<float>& SampleColumns::floats(const LocalSamples& samples, std::size_t column) const {
  if (column < 6) return samples.*kNormals[column - 3];
  if (column >= first_attribute_) return samples.attributes[column - first_attribute_];
  return column == 6 && has_radius_ ? samples.radius : samples.quality;
}

std::vector<float>& SampleColumns::floats(LocalSamples& samples, std::size_t column) const {
  return const_cast<std::vector<float>&>(floats(static_cast<const LocalSamples&>(samples), column));
}

void SampleColumns::check(const LocalSamples& samples) const {
  const std::size_t n = samples.size();
  bool good = samples.attributes.size() == size() - first_attribute_ && samples.y.size() == n && samples.z.size() == n;
  for (std::size_t c = 3; good && c < size(); ++c) good = floats(samples, c).size() == n;
  if (!good) {
    throw Error(ExitCode::internal,
                fmt::format("slab store: a batch of {} samples lacks an array that the store's layout has", n));
  }
}

void SampleColumns::resize(LocalSamples& samples, std::size_t n) const {
  if (!has_radius_) samples.radius.clear();
  if (!has_quality_) samples.quality.clear();
  samples.attributes.resize(size() - first_attribute_);
  for (const auto position : kPositions) resize_anew(samples.*position, n);
  for (std::size_t c = 3; c < size(); ++c) resize_anew(floats(samples, c), n);
}

void SampleColumns::scatter(const LocalSamples& samples, const PackedNormals& normals, std::size_t column,
                            std::span<const std::uint32_t> rows, std::span<const std::uint32_t> slots,
                            std::byte* chunks) const {
  const std::size_t chunk_bytes = kChunkRows * row_bytes();
  std::byte* to = chunks + kChunkRows * bytes_before(column);
  if (is_position(column)) {
    const std::int32_t* values = (samples.*kPositions[column]).data();
    return scatter_values(values, rows, slots, to, chunk_bytes, [](std::int32_t v) { return v; });
  }
  if (is_normal(column)) {
    const std::uint16_t* values = (normals.*kPacked[column - 3]).data();
    return scatter_values(values, rows, slots, to, chunk_bytes, [](std::uint16_t v) { return v; });
  }
  const float* values = floats(samples, column).data();
  with_type(types_[column], [&]<class T>(T) { scatter_values(values, rows, slots, to, chunk_bytes, to_rest<T>); });
}

std::byte* SampleColumns::data(LocalSamples& samples, std::size_t column) const {
  if (is_position(column)) return reinterpret_cast<std::byte*>((samples.*kPositions[column]).data());
  return reinterpret_cast<std::byte*>(floats(samples, column).data());
}

void SampleColumns::convert(const std::byte* rest, std::size_t count, LocalSamples& samples, std::size_t column,
                            std::size_t first) const {
  float* values = floats(samples, column).data() + first;
  with_type(types_[column], [&]<class T>(T) {
    for (std::size_t i = 0; i < count; ++i) {
      T value;
      std::memcpy(&value, rest + i * sizeof(T), sizeof(T));
      values[i] = static_cast<float>(value);
    }
  });
}

}  // namespace lamina
