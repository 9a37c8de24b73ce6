#include "points/las_records.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <string_view>

#include "base/little_endian.h"
#include "points/point_columns.h"

namespace lamina {
namespace {

using Coordinates = LasRecords::Coordinates;

constexpr std::size_t kRecordHeader = 54;
constexpr std::size_t kExtendedHeader = 60;
constexpr std::uint64_t kMostBytes = 64 << 10;
constexpr std::uint32_t kMostRecords = 4096;
constexpr std::size_t kDescriptor = 192;

std::string_view text_of(const std::byte* bytes, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(bytes), size);
  return text.substr(0, std::min(text.find('\0'), size));
}

/// GeoTIFF keys: a model type of 2 is geographic, 1 projected, 3 geocentric metres.
Coordinates kind_by_keys(const std::vector<std::byte>& keys) {
  constexpr std::uint16_t kModelType = 1024;
  for (std::size_t at = 8; at + 8 <= keys.size(); at += 8) {
    if (load_little<std::uint16_t>(keys.data() + at) != kModelType) continue;
    return load_little<std::uint16_t>(keys.data() + at + 6) == 2 ? Coordinates::geographic : Coordinates::projected;
  }
  return Coordinates::unknown;
}

/// Well-known text, of either generation; a projected system contains a geographic one.
Coordinates kind_by_text(std::string_view text) {
  for (const char* word : {"PROJCS", "PROJCRS", "PROJECTEDCRS", "GEOCCS", "LOCAL_CS", "ENGCRS", "CS[Cartesian"}) {
    if (text.find(word) != text.npos) return Coordinates::projected;
  }
  for (const char* word : {"GEOGCS", "GEOGCRS", "GEODCRS", "GEOGRAPHICCRS"}) {
    if (text.find(word) != text.npos) return Coordinates::geographic;
  }
  return Coordinates::unknown;
}

void take_record(std::string_view user, std::uint16_t id, std::vector<std::byte> bytes, LasRecords& records) {
  constexpr std::uint16_t kKeys = 34735;
  constexpr std::uint16_t kText = 2112;
  constexpr std::uint16_t kExtraBytes = 4;
  Coordinates kind = Coordinates::unknown;
  if (user == "LASF_Projection" && id == kKeys) kind = kind_by_keys(bytes);
  if (user == "LASF_Projection" && id == kText) kind = kind_by_text(text_of(bytes.data(), bytes.size()));
  if (kind != Coordinates::unknown) records.coordinates = kind;
  if (user == "LASF_Spec" && id == kExtraBytes) records.extra_bytes = std::move(bytes);
}

std::vector<std::byte> bytes_at(const InputFile& file, std::uint64_t offset, std::uint64_t size) {
  std::vector<std::byte> bytes(static_cast<std::size_t>(std::min(size, kMostBytes)));
  bytes.resize(file.read(offset, bytes.data(), bytes.size()));
  return bytes;
}

/// Both kinds differ in how long their length is.
void walk(const InputFile& file, std::uint64_t offset, std::uint32_t count, std::uint64_t end, bool extended,
          LasRecords& records) {
  const std::size_t header_bytes = extended ? kExtendedHeader : kRecordHeader;
  for (std::uint32_t i = 0; i < std::min(count, kMostRecords); ++i) {
    std::array<std::byte, kExtendedHeader> header{};
    if (offset > end || end - offset < header_bytes || file.read(offset, header.data(), header_bytes) < header_bytes)
      return;
    const std::uint64_t length =
        extended ? load_little<std::uint64_t>(header.data() + 20) : load_little<std::uint16_t>(header.data() + 20);
    offset += header_bytes;
    if (length > end - offset) return;
    const std::string_view user = text_of(header.data() + 2, 16);
    if (user.starts_with("LASF_")) {
      take_record(user, load_little<std::uint16_t>(header.data() + 18), bytes_at(file, offset, length), records);
    }
    offset += length;
  }
}

/// Bytes of one value by the specification's numbers 1 to 10.
constexpr std::array<std::size_t, 11> kValueBytes{0, 1, 1, 2, 2, 4, 4, 8, 8, 4, 8};

std::optional<ScalarType> scalar_type(unsigned number) {
  constexpr std::array kTypes{ScalarType::uint8, ScalarType::int8,   ScalarType::uint16,
                              ScalarType::int16, ScalarType::uint32, ScalarType::int32};
  if (number >= 1 && number <= kTypes.size()) return kTypes[number - 1];
  if (number == 9) return ScalarType::float32;
  if (number == 10) return ScalarType::float64;
  return std::nullopt;
}

}  // namespace

void read_las_records(const InputFile& file, std::uint64_t offset, std::uint32_t count, std::uint64_t end,
                      LasRecords& records) {
  walk(file, offset, count, end, false, records);
}

void read_las_extended_records(const InputFile& file, std::uint64_t offset, std::uint32_t count, LasRecords& records) {
  walk(file, offset, count, file.bytes, true, records);
}

std::vector<LasExtra> place_extras(const LasRecords& records, std::size_t standard_bytes, std::size_t record_bytes) {
  std::vector<LasExtra> extras;
  std::size_t offset = standard_bytes;
  for (std::size_t at = 0; at + kDescriptor <= records.extra_bytes.size(); at += kDescriptor) {
    const std::byte* d = records.extra_bytes.data() + at;
    const auto number = std::to_integer<unsigned>(d[2]);
    const auto options = std::to_integer<unsigned>(d[3]);
    if (number > 30) return extras;
    const unsigned values = number == 0 ? 1 : (number - 1) / 10 + 1;
    const std::size_t bytes = number == 0 ? options : values * kValueBytes[(number - 1) % 10 + 1];
    if (offset + bytes > record_bytes) return extras;
    const std::optional<ScalarType> type = scalar_type(number);
    if (type) {
      LasExtra extra{usual_name(text_of(d + 4, 32)), *type, offset};
      constexpr unsigned kScaled = 8;
      constexpr unsigned kShifted = 16;
      if ((options & kScaled) != 0) extra.scale = load_little<double>(d + 112);
      if ((options & kShifted) != 0) extra.shift = load_little<double>(d + 136);
      if (!extra.name.empty() && std::isfinite(extra.scale) && std::isfinite(extra.shift))
        extras.push_back(std::move(extra));
    }
    offset += bytes;
  }
  return extras;
}

}  // namespace lamina
