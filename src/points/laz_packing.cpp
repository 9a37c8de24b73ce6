#include "points/laz_packing.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "base/little_endian.h"
#include "lamina/error.h"

namespace lamina {
namespace {

/// A part of a point that has a coder of its own.
struct LazItem {
  enum Kind : std::uint16_t {
    bytes = 0,
    point10 = 6,
    gps_time = 7,
    colours = 8,
    point14 = 10,
    colours14 = 11,
    colours_infrared = 12,
    bytes14 = 14,
  };
  std::uint16_t kind = 0, size = 0, version = 0;
};

/// What points of a format are made of, extra bytes at the end.
std::vector<LazItem> items_of(int point_format, std::size_t extra_bytes) {
  std::vector<LazItem> items;
  const bool layered = point_format >= 6;
  items.push_back(layered ? LazItem{LazItem::point14, 30} : LazItem{LazItem::point10, 20});
  if (point_format == 1 || point_format == 3) items.push_back({LazItem::gps_time, 8});
  if (point_format == 2 || point_format == 3) items.push_back({LazItem::colours, 6});
  if (point_format == 7) items.push_back({LazItem::colours14, 6});
  if (point_format == 8) items.push_back({LazItem::colours_infrared, 8});
  if (extra_bytes > 0) {
    items.push_back({layered ? LazItem::bytes14 : LazItem::bytes, static_cast<std::uint16_t>(extra_bytes)});
  }
  return items;
}

std::size_t standard_bytes(int point_format) {
  std::size_t bytes = 0;
  for (const LazItem& item : items_of(point_format, 0)) bytes += item.size;
  return bytes;
}

}  // namespace

LazPacking parse_laz_packing(std::span<const std::byte> record, int point_format, std::size_t record_bytes,
                             const std::string& name) {
  const auto refuse = [&](const std::string& what) {
    throw Error(ExitCode::unreadable, fmt::format("{}: {}", name, what));
  };
  if (point_format == 4 || point_format == 5 || point_format >= 9) {
    refuse(
        fmt::format("compressed points of format {} (wave packets) are not read; leave the waves out: las2las -i "
                    "FILE -remove_all_evlrs -set_point_type {} -o OTHER.laz",
                    point_format,
                    point_format == 4   ? 1
                    : point_format == 5 ? 3
                    : point_format == 9 ? 6
                                        : 8));
  }
  constexpr std::size_t kHead = 34, kItem = 6;
  if (record.size() < kHead) {
    refuse(fmt::format("the record '{}', which says how points are compressed, is {}", kLazUser,
                       record.empty() ? "missing" : "cut short"));
  }
  constexpr unsigned kPointwise = 1, kChunked = 2, kLayered = 3;
  const unsigned compressor = load_little<std::uint16_t>(record.data());
  const unsigned coder = load_little<std::uint16_t>(record.data() + 2);
  const bool layered = point_format >= 6;
  const bool fits = layered ? compressor == kLayered : compressor == kPointwise || compressor == kChunked;
  if (!fits || coder != 0) {
    refuse(fmt::format("points of format {} are compressed by method {}.{}, which is not known", point_format,
                       compressor, coder));
  }
  LazPacking packing;
  packing.layered = layered;
  packing.chunked = compressor != kPointwise;
  packing.chunk_points = load_little<std::uint32_t>(record.data() + 12);
  if (packing.chunk_points == 0) packing.chunk_points = LazPacking::kVariable;
  packing.layout = {.bytes = record_bytes,
                    .extra_bytes = record_bytes - standard_bytes(point_format),
                    .gps_time = point_format == 1 || point_format == 3,
                    .colours = point_format == 2 || point_format == 3 || point_format == 7 || point_format == 8,
                    .infrared = point_format == 8};
  const std::vector<LazItem> wanted = items_of(point_format, packing.layout.extra_bytes);
  const std::size_t items = load_little<std::uint16_t>(record.data() + 32);
  if (items != wanted.size() || record.size() < kHead + kItem * items) {
    refuse(fmt::format("points of format {} have {} compressed items, not {}", point_format, wanted.size(), items));
  }
  for (std::size_t i = 0; i < items; ++i) {
    const std::byte* at = record.data() + kHead + kItem * i;
    const LazItem item{load_little<std::uint16_t>(at), load_little<std::uint16_t>(at + 2),
                       load_little<std::uint16_t>(at + 4)};
    if (item.kind != wanted[i].kind || item.size != wanted[i].size) {
      refuse(fmt::format("compressed item {} of the points is of kind {} and {} bytes; format {} has kind {} and {}", i,
                         item.kind, item.size, point_format, wanted[i].kind, wanted[i].size));
    }
    if (!layered && item.version == 1) {
      refuse("points are compressed as LASzip did before 2011; compress them anew: laszip -i FILE -o OTHER.laz");
    }
    if (layered ? item.version < 2 || item.version > 4 : item.version != 2) {
      refuse(fmt::format("compressed item {} of the points is of version {}, which is not known", i, item.version));
    }
    packing.layout.channels_apart = packing.layout.channels_apart || (layered && item.version == 4);
  }
  return packing;
}

std::string laz_packing_record(int point_format, std::size_t record_bytes, std::uint32_t chunk_points) {
  const std::vector<LazItem> items = items_of(point_format, record_bytes - standard_bytes(point_format));
  constexpr std::uint16_t kLayered = 3, kArithmetic = 0;
  constexpr std::uint16_t kVersion = 3;  // of items; any program of the last years reads it
  std::string data;
  append_little(data, kLayered);
  append_little(data, kArithmetic);
  data += {3, 4};  // LASzip's version that this is like
  append_little(data, std::uint16_t{3});
  append_little(data, std::uint32_t{0});  // options
  append_little(data, chunk_points);
  append_little(data, std::int64_t{-1});  // no special records behind the points
  append_little(data, std::int64_t{-1});
  append_little(data, static_cast<std::uint16_t>(items.size()));
  for (const LazItem& item : items) {
    append_little(data, item.kind);
    append_little(data, item.size);
    append_little(data, kVersion);
  }
  std::string record(2, '\0');
  std::string user = kLazUser;
  user.resize(16);
  record += user;
  append_little(record, kLazRecord);
  append_little(record, static_cast<std::uint16_t>(data.size()));
  record += std::string(32, '\0');
  return record + data;
}

}  // namespace lamina
