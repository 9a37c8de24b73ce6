#include "store/block_codec.h"

#include <blosc.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <type_traits>

#include "base/vectors.h"
#include "lamina/error.h"

namespace lamina {
namespace {

// The octahedron |x| + |y| + |z| = 1 seen from above, its lower half folded over the edges of the upper one (Meyer,
// Suessmuth, Sussner, Stamminger and Greiner, "On floating-point normal vectors", 2010). Zero and one are on the grid.
constexpr float kScale = 8388606.0F;  // 2^23 - 2: integers up to here are floats, and its half is one
constexpr std::int32_t kMiddle = 1 << 23;

}  // namespace

void pack_normals(const std::array<const float*, 3>& normals, std::size_t count,
                  const std::array<std::uint16_t*, 3>& packed) {
  const auto [nx, ny, nz] = normals;
  const auto [u, v, low] = packed;
  for (std::size_t i = 0; i < count; ++i) {
    const float sum = std::abs(nx[i]) + std::abs(ny[i]) + std::abs(nz[i]);
    const float inverse = sum > 0 ? kScale / sum : 0.0F;
    const float x = nx[i] * inverse;
    const float y = ny[i] * inverse;
    const float folded_x = std::copysign(kScale - std::abs(y), x);
    const float folded_y = std::copysign(kScale - std::abs(x), y);
    const bool below = nz[i] < 0;
    const float a = below ? folded_x : x;
    const float b = below ? folded_y : y;
    // Rounded away from zero by truncation, which unlike a call to lrint() is vector code; at most one above the scale.
    const auto p =
        std::clamp(static_cast<std::int32_t>(a + std::copysign(0.5F, a)), 1 - kMiddle, kMiddle - 1) + kMiddle;
    const auto q =
        std::clamp(static_cast<std::int32_t>(b + std::copysign(0.5F, b)), 1 - kMiddle, kMiddle - 1) + kMiddle;
    u[i] = static_cast<std::uint16_t>(p >> 8);
    v[i] = static_cast<std::uint16_t>(q >> 8);
    low[i] = static_cast<std::uint16_t>((p & 0xFF) | (q & 0xFF) << 8);
  }
}

void unpack_normals(const std::array<const std::uint16_t*, 3>& packed, std::size_t count,
                    const std::array<float*, 3>& normals) {
  const auto [u, v, low] = packed;
  const auto [nx, ny, nz] = normals;
  for (std::size_t i = 0; i < count; ++i) {
    const std::int32_t p = (std::int32_t{u[i]} << 8 | (low[i] & 0xFF)) - kMiddle;
    const std::int32_t q = (std::int32_t{v[i]} << 8 | low[i] >> 8) - kMiddle;
    float x = static_cast<float>(p);
    float y = static_cast<float>(q);
    // Sums of integers below 2^24: exact.
    const float z = kScale - std::abs(x) - std::abs(y);
    const float fold = std::max(-z, 0.0F);
    x -= std::copysign(fold, x);
    y -= std::copysign(fold, y);
    const float inverse = 1.0F / std::sqrt(x * x + y * y + z * z);
    nx[i] = x * inverse;
    ny[i] = y * inverse;
    nz[i] = z * inverse;
  }
}

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

void SampleColumns::resize(LocalSamples& samples, std::size_t n, Columns wanted) const {
  if (!has_radius_) samples.radius.clear();
  if (!has_quality_) samples.quality.clear();
  samples.attributes.resize(size() - first_attribute_);
  for (const auto position : kPositions) resize_anew(samples.*position, n);
  for (std::size_t c = 3; c < size(); ++c) resize_anew(floats(samples, c), wanted == Columns::all ? n : 0);
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

namespace {

constexpr int kLevel = 1;
constexpr const char* kCompressor = BLOSC_LZ4_COMPNAME;

/// A block begins with one of these for each column; the compressed columns follow in order.
struct ColumnHeader {
  std::uint32_t bytes = 0;  ///< compressed
  std::int32_t base = 0;    ///< positions: subtracted from every value, or the first value when they are differences
  std::uint32_t differences = 0;
};

void gather(std::span<const std::byte* const> chunks, std::size_t column_offset, std::size_t value_bytes,
            std::size_t count, std::byte* to) {
  for (const std::byte* chunk : chunks) {
    const std::size_t rows = std::min<std::size_t>(count, kChunkRows);
    std::memcpy(to, chunk + column_offset, rows * value_bytes);
    to += rows * value_bytes;
    count -= rows;
  }
}

/// Small differences of either sign become small numbers.
std::uint32_t zigzag(std::uint32_t difference) {
  return (difference << 1) ^ (0U - (difference >> 31));
}

/// Makes the high bytes of positions alike. Differences (zigzag) pay where samples come in the order of a scan line;
/// for random order they are as long as the offsets, so they must win clearly.
void flatten(std::span<std::uint32_t> values, ColumnHeader& header) {
  std::int32_t lowest = static_cast<std::int32_t>(values[0]);
  for (const auto v : values) lowest = std::min(lowest, static_cast<std::int32_t>(v));
  const auto origin = static_cast<std::uint32_t>(lowest);
  std::uint64_t offsets = 0;
  for (const auto v : values) offsets += v - origin;
  std::uint64_t differences = 0;
  for (std::size_t i = 1; i < values.size(); ++i) differences += zigzag(values[i] - values[i - 1]);
  header.differences = differences < offsets / 4 ? 1 : 0;
  if (header.differences == 0) {
    header.base = lowest;
    for (auto& v : values) v -= origin;
    return;
  }
  header.base = static_cast<std::int32_t>(values[0]);
  for (std::size_t i = values.size() - 1; i > 0; --i) values[i] = zigzag(values[i] - values[i - 1]);
  values[0] = 0;
}

void unflatten(std::span<std::uint32_t> values, const ColumnHeader& header) {
  auto base = static_cast<std::uint32_t>(header.base);
  if (header.differences == 0) {
    for (auto& v : values) v += base;
    return;
  }
  for (auto& v : values) {
    base += (v >> 1) ^ (0U - (v & 1U));
    v = base;
  }
}

/// Blosc does not look whether it gets the memory it asks for, and crashes: so does the program ask before.
void require_memory(std::size_t bytes) {
  const auto memory = std::make_unique_for_overwrite<std::byte[]>(bytes);
  *static_cast<volatile std::byte*>(memory.get()) = std::byte{};  // or the compiler leaves it all out
}

}  // namespace

std::size_t block_bound(const SampleColumns& columns, std::size_t rows) {
  return columns.size() * (sizeof(ColumnHeader) + BLOSC_MAX_OVERHEAD) + rows * columns.row_bytes();
}

std::size_t encode_block(const SampleColumns& columns, std::span<const std::byte* const> chunks, std::size_t count,
                         std::span<std::uint32_t> scratch, std::span<std::byte> block) {
  const std::size_t header_bytes = columns.size() * sizeof(ColumnHeader);
  std::size_t end = header_bytes;
  for (std::size_t c = 0; c < columns.size(); ++c) {
    const std::size_t value_bytes = columns.bytes(c);
    gather(chunks, kChunkRows * columns.bytes_before(c), value_bytes, count,
           reinterpret_cast<std::byte*>(scratch.data()));
    ColumnHeader header;
    if (SampleColumns::is_position(c)) flatten(scratch.first(count), header);
    // Given more room than this, Blosc may use it for small blocks instead of storing them plainly.
    const std::size_t room = count * value_bytes + BLOSC_MAX_OVERHEAD;
    require_memory(2 * room);
    const int bytes =
        blosc_compress_ctx(SampleColumns::is_noise(c) ? 0 : kLevel, BLOSC_SHUFFLE, value_bytes, count * value_bytes,
                           scratch.data(), block.data() + end, room, kCompressor, 0, 1);
    if (bytes <= 0) throw Error(ExitCode::internal, fmt::format("slab store: Blosc refused {} values", count));
    header.bytes = static_cast<std::uint32_t>(bytes);
    std::memcpy(block.data() + c * sizeof(ColumnHeader), &header, sizeof(header));
    end += header.bytes;
  }
  return end;
}

bool decode_block(const SampleColumns& columns, std::span<const std::byte> block, std::size_t count, LocalSamples& out,
                  std::size_t first, Columns wanted) {
  std::size_t begin = columns.size() * sizeof(ColumnHeader);
  if (block.size() < begin) return false;
  std::vector<std::byte> scratch;
  std::vector<std::uint16_t> normals;  // the three columns after each other
  for (std::size_t c = 0; c < columns.size(); ++c) {
    if (wanted == Columns::positions && !SampleColumns::is_position(c)) return true;
    ColumnHeader header;
    std::memcpy(&header, block.data() + c * sizeof(ColumnHeader), sizeof(header));
    const std::size_t bytes = count * columns.bytes(c);
    std::size_t promised = 0;
    if (header.bytes > block.size() - begin ||
        blosc_cbuffer_validate(block.data() + begin, header.bytes, &promised) != 0 || promised != bytes) {
      return false;
    }
    std::byte* to = nullptr;
    if (SampleColumns::is_normal(c)) {
      normals.resize(3 * count);
      to = reinterpret_cast<std::byte*>(normals.data() + (c - 3) * count);
    } else if (columns.is_direct(c)) {
      to = columns.data(out, c) + first * columns.bytes(c);
    } else {
      scratch.resize(bytes);
      to = scratch.data();
    }
    require_memory(2 * bytes + BLOSC_MAX_OVERHEAD);
    if (blosc_decompress_ctx(block.data() + begin, to, bytes, 1) != static_cast<int>(bytes)) return false;
    if (SampleColumns::is_position(c)) {
      unflatten({reinterpret_cast<std::uint32_t*>(to), count}, header);
    } else if (c == 5) {
      const std::uint16_t* const u = normals.data();
      unpack_normals({u, u + count, u + 2 * count}, count,
                     {out.nx.data() + first, out.ny.data() + first, out.nz.data() + first});
    } else if (!SampleColumns::is_normal(c) && !columns.is_direct(c)) {
      columns.convert(to, count, out, c, first);
    }
    begin += header.bytes;
  }
  return begin == block.size();
}

}  // namespace lamina
