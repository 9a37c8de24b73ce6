#include "points/las.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <string_view>
#include <utility>

#include "base/number.h"
#include "lamina/error.h"
#include "points/ply_header.h"
#include "points/point_columns.h"

namespace lamina {
namespace {

struct LasVariableRecords {
  enum class Coordinates { unknown, projected, geographic };
  Coordinates coordinates = Coordinates::unknown;
  std::string text, number;            ///< of the coordinate system: well-known text, EPSG:NUMBER
  std::vector<std::byte> extra_bytes;  ///< descriptors of 192 bytes each
  std::vector<std::byte> packing;      ///< LASzip's record
  std::vector<std::byte> octree;       ///< COPC's
};

using Coordinates = LasVariableRecords::Coordinates;

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

/// EPSG:NUMBER of the projected system, else of the geographic one; empty where the keys have none.
std::string number_by_keys(const std::vector<std::byte>& keys) {
  constexpr std::uint16_t kGeographic = 2048, kProjected = 3072, kOwn = 32767;
  std::string found;
  for (std::size_t at = 8; at + 8 <= keys.size(); at += 8) {
    const auto key = load_little<std::uint16_t>(keys.data() + at);
    const auto value = load_little<std::uint16_t>(keys.data() + at + 6);
    const bool in_place = load_little<std::uint16_t>(keys.data() + at + 2) == 0;
    if (!in_place || value == 0 || value == kOwn || (key != kGeographic && key != kProjected)) continue;
    if (key == kProjected || found.empty()) found = fmt::format("EPSG:{}", value);
  }
  return found;
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

void take_record(std::string_view user, std::uint16_t id, std::vector<std::byte> bytes, LasVariableRecords& records) {
  constexpr std::uint16_t kKeys = 34735;
  constexpr std::uint16_t kText = 2112;
  constexpr std::uint16_t kExtraBytes = 4;
  Coordinates kind = Coordinates::unknown;
  if (user == "LASF_Projection" && id == kKeys) {
    kind = kind_by_keys(bytes);
    records.number = number_by_keys(bytes);
  } else if (user == "LASF_Projection" && id == kText) {
    records.text = text_of(bytes.data(), bytes.size());
    kind = kind_by_text(records.text);
  }
  if (kind != Coordinates::unknown) records.coordinates = kind;
  if (user == "LASF_Spec" && id == kExtraBytes) {
    records.extra_bytes = std::move(bytes);
  } else if (user == kLazUser && id == kLazRecord) {
    records.packing = std::move(bytes);
  } else if (user == kCopcUser && id == kCopcRecord) {
    records.octree = std::move(bytes);
  }
}

std::vector<std::byte> bytes_at(const InputFile& file, std::uint64_t offset, std::uint64_t size) {
  std::vector<std::byte> bytes(static_cast<std::size_t>(std::min(size, kMostBytes)));
  bytes.resize(file.read(offset, bytes.data(), bytes.size()));
  return bytes;
}

/// Both kinds differ in how long their length is.
void walk(const InputFile& file, std::uint64_t offset, std::uint32_t count, std::uint64_t end, bool extended,
          LasVariableRecords& records) {
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
    if (user.starts_with("LASF_") || user == kLazUser || user == kCopcUser) {
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

constexpr std::size_t kOldHeader = 227;
constexpr std::size_t kHeader14 = 375;
constexpr std::size_t kExtendedRecords = 235;  ///< where their offset stands
constexpr std::array<std::size_t, 11> kRecordBytes{20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67};
constexpr std::array<std::size_t, 11> kColourOffset{0, 0, 20, 28, 0, 28, 0, 30, 30, 0, 30};

[[noreturn]] void refuse(const InputFile& file, const std::string& what) {
  throw Error(ExitCode::unreadable, fmt::format("{}: {}", file.name, what));
}

/// Degrees are written with steps of 1e-7 or so for x and y and millimetres for z, which nothing else is.
bool looks_geographic(const LasHeader& h) {
  constexpr double kDegreeStep = 1e-6;
  return std::abs(h.low[0]) <= 180 && std::abs(h.high[0]) <= 180 && std::abs(h.low[1]) <= 90 &&
         std::abs(h.high[1]) <= 90 && h.scale[0] <= kDegreeStep && h.scale[1] <= kDegreeStep &&
         h.scale[2] >= 1000 * std::max(h.scale[0], h.scale[1]);
}

/// The `count` records from `offset` on, as far as they end before `end`; a damaged list ends where it stops making
/// sense, as no point depends on it.
void read_las_records(const InputFile& file, std::uint64_t offset, std::uint32_t count, std::uint64_t end,
                      LasVariableRecords& records) {
  walk(file, offset, count, end, false, records);
}

/// The same for those behind the points, which may be longer than 64 kB.
void read_las_extended_records(const InputFile& file, std::uint64_t offset, std::uint32_t count,
                               LasVariableRecords& records) {
  walk(file, offset, count, file.bytes, true, records);
}

/// Where the described extra values lie in a record of `record_bytes` with `standard_bytes` before them. Arrays,
/// integers of 64 bits and undocumented bytes are passed over.
std::vector<LasExtra> place_extras(const LasVariableRecords& records, std::size_t standard_bytes,
                                   std::size_t record_bytes) {
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

/// Version, sizes and the points' format. Returns the bytes of the header by its own account.
std::uint16_t read_layout(const InputFile& file, const std::byte* bytes, std::size_t got, LasHeader& h) {
  if (got < kOldHeader) refuse(file, fmt::format("the LAS header is cut short: {} bytes of {}", got, kOldHeader));
  const int major = std::to_integer<int>(bytes[24]);
  h.minor = std::to_integer<int>(bytes[25]);
  if (major != 1 || h.minor > 4)
    refuse(file, fmt::format("LAS version {}.{} is not supported; 1.0 to 1.4 are", major, h.minor));
  const std::size_t least = h.minor >= 4 ? kHeader14 : kOldHeader;
  const auto header_bytes = load_little<std::uint16_t>(bytes + 94);
  if (header_bytes < least || header_bytes > file.bytes || got < least) {
    refuse(file, fmt::format("the LAS header says it has {} bytes (at byte 94), which no version {}.{} has",
                             header_bytes, major, h.minor));
  }
  h.data = load_little<std::uint32_t>(bytes + 96);
  // LAZ shares LAS's signature and marks itself in the point format.
  constexpr int kCompressed = 0xC0;
  h.point_format = std::to_integer<int>(bytes[104]);
  if ((h.point_format & kCompressed) != 0) h.packing.emplace();
  h.point_format &= ~kCompressed;
  if (h.point_format >= static_cast<int>(kRecordBytes.size())) {
    refuse(file, fmt::format("point format {} (at byte 104) is not known; 0 to 10 are", h.point_format));
  }
  h.record_bytes = load_little<std::uint16_t>(bytes + 105);
  if (h.record_bytes < las_record_bytes(h.point_format)) {
    refuse(file, fmt::format("points have {} bytes (at byte 105), format {} needs {}", h.record_bytes, h.point_format,
                             las_record_bytes(h.point_format)));
  }
  return header_bytes;
}

void read_coordinates(const InputFile& file, const std::byte* bytes, LasHeader& h) {
  for (std::size_t k = 0; k < 3; ++k) {
    h.scale[k] = load_little<double>(bytes + 131 + 8 * k);
    h.offset[k] = load_little<double>(bytes + 155 + 8 * k);
    h.high[k] = load_little<double>(bytes + 179 + 16 * k);
    h.low[k] = load_little<double>(bytes + 187 + 16 * k);
    if (!std::isfinite(h.scale[k]) || h.scale[k] == 0 || !std::isfinite(h.offset[k])) {
      refuse(file, fmt::format("the scale {} and offset {} of axis {} (at bytes {} and {}) make no coordinates",
                               h.scale[k], h.offset[k], k, 131 + 8 * k, 155 + 8 * k));
    }
  }
}

/// Whether the counts by return tell of any but the first.
bool counts_several_returns(const std::byte* bytes, int minor) {
  constexpr std::size_t kSecond = 115, kOldReturns = 4, kSecond14 = 263, kReturns14 = 14;
  for (std::size_t k = 0; k < kOldReturns; ++k) {
    if (load_little<std::uint32_t>(bytes + kSecond + 4 * k) > 0) return true;
  }
  for (std::size_t k = 0; minor >= 4 && k < kReturns14; ++k) {
    if (load_little<std::uint64_t>(bytes + kSecond14 + 8 * k) > 0) return true;
  }
  return false;
}

/// A compressed point takes a hundredth of a bit at the very least. The chunk table tells more.
void require_compressed_room(const InputFile& file, const LasHeader& h) {
  constexpr std::uint64_t kMostPerByte = 1000;
  if (h.count / kMostPerByte <= file.bytes - h.data) return;
  refuse(file, fmt::format("the header promises {} points, for which {} compressed bytes are too few: it was cut short "
                           "or the header's count is wrong",
                           h.count, file.bytes - h.data));
}

/// Compares the count with the room there is.
void require_room(const InputFile& file, const std::byte* bytes, std::uint16_t header_bytes, LasHeader& h) {
  if (h.data < header_bytes || h.data > file.bytes) {
    refuse(file, fmt::format("points begin at byte {}, which is {} (at byte 96)", h.data,
                             h.data < header_bytes ? "inside the header" : "behind the end of the file"));
  }
  if (h.packing) return require_compressed_room(file, h);
  // Points end where the file does, or what is announced to lie behind them begins.
  std::uint64_t end = file.bytes;
  constexpr std::size_t kWaves = 227;
  for (const auto& [place, minor] : {std::pair{kWaves, 3}, std::pair{kExtendedRecords, 4}}) {
    if (h.minor < minor || header_bytes < place + sizeof(std::uint64_t)) continue;
    if (const auto begin = load_little<std::uint64_t>(bytes + place); begin > h.data) end = std::min(end, begin);
  }
  const std::uint64_t room = (file.bytes - h.data) / h.record_bytes;
  if (h.count > room) {
    refuse(file,
           fmt::format("the header promises {} points, the file holds {} of {} bytes each: it was cut short or the "
                       "header's count is wrong",
                       h.count, room, h.record_bytes));
  }
  h.uncounted = (end - h.data) / h.record_bytes;
  h.uncounted -= std::min(h.uncounted, h.count);
  if (h.count == 0 && h.uncounted > 0) {
    refuse(file, fmt::format("the header counts no points (at byte {}), but there is room for {}: its writer was "
                             "stopped before it knew their number",
                             h.minor >= 4 ? 247 : 107, h.uncounted));
  }
}

}  // namespace

std::size_t las_record_bytes(int point_format) {
  return kRecordBytes.at(static_cast<std::size_t>(point_format));
}

std::size_t las_colour_offset(int point_format) {
  return kColourOffset.at(static_cast<std::size_t>(point_format));
}

LasHeader read_las_header(const InputFile& file) {
  std::array<std::byte, kHeader14> header{};
  const std::byte* const bytes = header.data();
  LasHeader h;
  const std::uint16_t header_bytes = read_layout(file, bytes, file.read(0, header.data(), header.size()), h);
  h.count = load_little<std::uint32_t>(bytes + 107);
  if (const auto wide = load_little<std::uint64_t>(bytes + 247); h.minor >= 4 && wide != 0) h.count = wide;
  h.several_returns = counts_several_returns(bytes, h.minor);
  read_coordinates(file, bytes, h);
  require_room(file, bytes, header_bytes, h);
  LasVariableRecords records;
  read_las_records(file, header_bytes, load_little<std::uint32_t>(bytes + 100), h.data, records);
  if (h.minor >= 4) {
    read_las_extended_records(file, load_little<std::uint64_t>(bytes + kExtendedRecords),
                              load_little<std::uint32_t>(bytes + 243), records);
  }
  h.geographic =
      records.coordinates == LasVariableRecords::Coordinates::geographic ||
      (records.coordinates == LasVariableRecords::Coordinates::unknown && h.count > 0 && looks_geographic(h));
  if (h.packing) h.packing = parse_laz_packing(records.packing, h.point_format, h.record_bytes, file.name);
  if (h.packing) h.octree = std::move(records.octree);
  h.crs = one_line(records.text.empty() ? records.number : records.text);
  h.extras = place_extras(records, las_record_bytes(h.point_format), h.record_bytes);
  return h;
}

}  // namespace lamina
