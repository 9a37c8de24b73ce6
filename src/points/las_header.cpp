#include "points/las_header.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "lamina/error.h"
#include "points/las_records.h"
#include "base/little_endian.h"

namespace lamina {
namespace {

constexpr std::size_t kOldHeader = 227;
constexpr std::size_t kHeader14 = 375;
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

}  // namespace

std::size_t las_record_bytes(int point_format) {
  return kRecordBytes.at(static_cast<std::size_t>(point_format));
}

std::size_t las_colour_offset(int point_format) {
  return kColourOffset.at(static_cast<std::size_t>(point_format));
}

LasHeader read_las_header(const InputFile& file) {
  std::array<std::byte, kHeader14> bytes{};
  const std::size_t got = file.read(0, bytes.data(), bytes.size());
  if (got < kOldHeader) refuse(file, fmt::format("the LAS header is cut short: {} bytes of {}", got, kOldHeader));
  const auto at = [&](std::size_t offset) { return bytes.data() + offset; };
  const int major = std::to_integer<int>(bytes[24]);
  LasHeader h;
  h.minor = std::to_integer<int>(bytes[25]);
  if (major != 1 || h.minor > 4)
    refuse(file, fmt::format("LAS version {}.{} is not supported; 1.0 to 1.4 are", major, h.minor));
  const auto header_bytes = load_little<std::uint16_t>(at(94));
  if (header_bytes < (h.minor >= 4 ? kHeader14 : kOldHeader) || header_bytes > file.bytes ||
      got < (h.minor >= 4 ? kHeader14 : kOldHeader)) {
    refuse(file, fmt::format("the LAS header says it has {} bytes (at byte 94), which no version {}.{} has",
                             header_bytes, major, h.minor));
  }
  h.data = load_little<std::uint32_t>(at(96));
  h.point_format = std::to_integer<int>(bytes[104]);
  if (h.point_format >= static_cast<int>(kRecordBytes.size())) {
    refuse(file, fmt::format("point format {} (at byte 104) is not known; 0 to 10 are", h.point_format));
  }
  h.record_bytes = load_little<std::uint16_t>(at(105));
  if (h.record_bytes < las_record_bytes(h.point_format)) {
    refuse(file, fmt::format("points have {} bytes (at byte 105), format {} needs {}", h.record_bytes, h.point_format,
                             las_record_bytes(h.point_format)));
  }
  h.count = load_little<std::uint32_t>(at(107));
  if (const auto wide = load_little<std::uint64_t>(at(247)); h.minor >= 4 && wide != 0) h.count = wide;
  for (std::size_t k = 0; k < 3; ++k) {
    h.scale[k] = load_little<double>(at(131 + 8 * k));
    h.offset[k] = load_little<double>(at(155 + 8 * k));
    h.high[k] = load_little<double>(at(179 + 16 * k));
    h.low[k] = load_little<double>(at(187 + 16 * k));
    if (!std::isfinite(h.scale[k]) || h.scale[k] == 0 || !std::isfinite(h.offset[k])) {
      refuse(file, fmt::format("the scale {} and offset {} of axis {} (at bytes {} and {}) make no coordinates",
                               h.scale[k], h.offset[k], k, 131 + 8 * k, 155 + 8 * k));
    }
  }
  if (h.data < header_bytes || h.data > file.bytes) {
    refuse(file, fmt::format("points begin at byte {}, which is {} (at byte 96)", h.data,
                             h.data < header_bytes ? "inside the header" : "behind the end of the file"));
  }
  // Points end where the file does, or what is announced to lie behind them begins.
  std::uint64_t end = file.bytes;
  constexpr std::size_t kWaves = 227;
  constexpr std::size_t kExtendedRecords = 235;
  for (const auto& [place, minor] : {std::pair{kWaves, 3}, std::pair{kExtendedRecords, 4}}) {
    if (h.minor < minor || header_bytes < place + sizeof(std::uint64_t)) continue;
    if (const auto begin = load_little<std::uint64_t>(at(place)); begin > h.data) end = std::min(end, begin);
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
  LasRecords records;
  read_las_records(file, header_bytes, load_little<std::uint32_t>(at(100)), h.data, records);
  if (h.minor >= 4) {
    read_las_extended_records(file, load_little<std::uint64_t>(at(kExtendedRecords)),
                              load_little<std::uint32_t>(at(243)), records);
  }
  h.geographic = records.coordinates == LasRecords::Coordinates::geographic ||
                 (records.coordinates == LasRecords::Coordinates::unknown && h.count > 0 && looks_geographic(h));
  h.extras = place_extras(records, las_record_bytes(h.point_format), h.record_bytes);
  return h;
}

}  // namespace lamina
