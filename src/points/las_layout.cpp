#include "points/las.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <set>
#include <string_view>
#include <utility>

#include "base/number.h"
#include "lamina/error.h"
#include "lamina/run.h"

namespace lamina {

std::vector<LasField> las_fields(int point_format) {
  using Type = ScalarType;
  constexpr double kAngleStep = 0.006;
  if (point_format >= 6) {
    return {{"return_number", Type::uint8, 14, 0, 4},
            {"number_of_returns", Type::uint8, 14, 4, 4},
            {"class_flags", Type::uint8, 15, 0, 4},
            {"scanner_channel", Type::uint8, 15, 4, 2},
            {"scan_direction", Type::uint8, 15, 6, 1},
            {"edge_of_flight_line", Type::uint8, 15, 7, 1},
            {"classification", Type::uint8, 16},
            {"user_data", Type::uint8, 17},
            {"scan_angle", Type::int16, 18, 0, 0, kAngleStep},
            {"point_source", Type::uint16, 20},
            {"gps_time", Type::float64, 22}};
  }
  std::vector<LasField> fields{{"return_number", Type::uint8, 14, 0, 3},
                               {"number_of_returns", Type::uint8, 14, 3, 3},
                               {"scan_direction", Type::uint8, 14, 6, 1},
                               {"edge_of_flight_line", Type::uint8, 14, 7, 1},
                               {"classification", Type::uint8, 15, 0, 5},
                               {"class_flags", Type::uint8, 15, 5, 3},
                               {"scan_angle", Type::int8, 16},
                               {"user_data", Type::uint8, 17},
                               {"point_source", Type::uint16, 18}};
  if (point_format == 1 || point_format >= 3) fields.push_back({"gps_time", Type::float64, 20});
  return fields;
}

namespace {

constexpr std::size_t kHeaderBytes = 375;
constexpr std::size_t kRecordHeaderBytes = 54;
constexpr std::size_t kDescriptorBytes = 192;
constexpr std::size_t kName = 32;

template <class T>
void put_at(std::string& bytes, std::size_t at, T value) {
  store_little(reinterpret_cast<std::byte*>(bytes.data()) + at, value);
}

/// The value in the given type, little-endian.
std::byte* put_typed(std::byte* to, ScalarType type, double value) {
  return with_scalar_type(type, [&](auto zero) { return store_little(to, to_scalar<decltype(zero)>(value)); });
}

/// The specification's number of a type.
int extra_type(ScalarType type) {
  switch (type) {
    case ScalarType::uint8:
      return 1;
    case ScalarType::int8:
      return 2;
    case ScalarType::uint16:
      return 3;
    case ScalarType::int16:
      return 4;
    case ScalarType::uint32:
      return 5;
    case ScalarType::int32:
      return 6;
    case ScalarType::float32:
      return 9;
    case ScalarType::float64:
      break;
  }
  return 10;
}

/// What brings a colour's type to 16 bits.
double colour_scale(ScalarType type) {
  return type == ScalarType::uint8 ? 257 : type == ScalarType::uint16 ? 1 : 65535;
}

/// The number of EPSG:NUMBER; 0 where it is none that GeoTIFF keys have room for.
std::uint16_t epsg_number(const std::string& crs) {
  constexpr std::string_view kLead = "EPSG:";
  constexpr std::uint16_t kOwn = 32767;  // a system that other keys would describe
  std::uint16_t number = 0;
  if (!crs.starts_with(kLead)) return 0;
  const char* const end = crs.data() + crs.size();
  const auto [stop, bad] = std::from_chars(crs.data() + kLead.size(), end, number);
  return bad == std::errc() && stop == end && number != kOwn ? number : std::uint16_t{0};
}

/// A directory of two GeoTIFF keys: what kind of system, and which.
std::string geotiff_keys(std::uint16_t number, bool geographic) {
  constexpr std::uint16_t kModelType = 1024, kGeographic = 2048, kProjected = 3072;
  const std::array<std::uint16_t, 12> words{
      1, 1, 0,     2, kModelType, 0, 1, std::uint16_t(geographic ? 2 : 1), geographic ? kGeographic : kProjected,
      0, 1, number};
  std::string keys;
  for (const std::uint16_t word : words) append_little(keys, word);
  return keys;
}

/// A variable length record of the coordinate system.
std::string projection_record(std::uint16_t id, const std::string& content) {
  std::string record(kRecordHeaderBytes, '\0');
  record.replace(2, 15, "LASF_Projection");
  put_at(record, 18, id);
  put_at(record, 20, static_cast<std::uint16_t>(content.size()));
  return record + content;
}

double attribute_of(const SampleBatch& batch, std::size_t attribute, std::size_t row) {
  const bool exact = attribute < batch.exact.size() && !batch.exact[attribute].empty();
  return exact ? batch.exact[attribute][row] : double{batch.attributes[attribute][row]};
}

/// The least and the largest number in the record's bits.
std::pair<double, double> room_of(const LasField& field) {
  constexpr double kLargestAngle = 30000;  // half a turn, as the specification has it
  if (field.scale != 1) return {-kLargestAngle, kLargestAngle};
  const unsigned bits = field.bits > 0 ? field.bits : 8U * static_cast<unsigned>(byte_size(field.stored));
  return {0, static_cast<double>((1U << bits) - 1)};
}

}  // namespace

LasLayout::LasLayout(const PointColumns& columns) : columns_(columns) {
  const auto find = [&](const char* name) {
    return std::find_if(columns.attributes.begin(), columns.attributes.end(),
                        [&](const AttributeSpec& a) { return a.name == name; }) -
           columns.attributes.begin();
  };
  constexpr std::array kColours{"red", "green", "blue"};
  const auto size = static_cast<std::ptrdiff_t>(columns.attributes.size());
  colours_ = std::all_of(kColours.begin(), kColours.end(), [&](const char* name) { return find(name) < size; });
  for (std::size_t k = 0; k < 3 && colours_; ++k) colour_.at(k) = static_cast<std::size_t>(find(kColours.at(k)));
  if (const auto at = find("intensity"); at < size) {
    const ScalarType type = columns.attributes[static_cast<std::size_t>(at)].type;
    if (type == ScalarType::uint8 || type == ScalarType::uint16) intensity_ = static_cast<int>(at);
  }
  for (const LasField& field : las_fields(point_format())) {
    if (const auto at = find(std::string(field.name).c_str()); at < size) {
      fields_.push_back({field, static_cast<std::size_t>(at)});
    }
  }
  if (columns.normals) {
    for (const char* name : {"nx", "ny", "nz"}) extras_.push_back({name});
  }
  if (!columns.radius.empty()) extras_.push_back({columns.radius});
  if (!columns.quality.empty()) extras_.push_back({columns.quality});
  for (std::size_t a = 0; a < columns.attributes.size(); ++a) {
    const bool colour = colours_ && std::find(colour_.begin(), colour_.end(), a) != colour_.end();
    const bool field = std::any_of(fields_.begin(), fields_.end(), [&](const OwnPlace& p) { return p.attribute == a; });
    if (colour || field || intensity_ == static_cast<int>(a)) continue;
    others_.push_back(a);
    extras_.push_back({columns.attributes[a].name, columns.attributes[a].type});
  }
  std::set<std::string> seen{"x", "y", "z"};
  record_bytes_ = las_record_bytes(point_format());
  for (const LasExtraColumn& extra : extras_) {
    if (extra.name.empty() || extra.name.size() > kName || !seen.insert(extra.name).second) {
      throw Error(ExitCode::internal,
                  fmt::format("column '{}' cannot be written to a LAS: its name is empty, longer than {} "
                              "characters, or there twice",
                              extra.name, kName));
    }
    record_bytes_ += static_cast<std::size_t>(byte_size(extra.type));
  }
  if (extras_.size() > 300) throw Error(ExitCode::internal, "a LAS has room for 300 columns besides its own");
}

std::string LasLayout::header(const LasTotals& totals, const std::string& packing) const {
  const std::array<LasAxis, 3>& axes = totals.axes;
  const std::size_t records = extras_.empty() ? 0 : kRecordHeaderBytes + kDescriptorBytes * extras_.size();
  std::string b(kHeaderBytes + records, '\0');
  b.replace(0, 4, "LASF");
  constexpr unsigned kTextProjection = 16, kAdjustedTimes = 1;
  put_at(
      b, 6,
      static_cast<std::uint16_t>((system_text_ ? kTextProjection : 0) | (totals.adjusted_times ? kAdjustedTimes : 0)));
  b[24] = 1;
  b[25] = 4;
  const std::string maker = fmt::format("lamina {}", version()).substr(0, kName);
  b.replace(26, 10, "EXTRACTION");
  b.replace(58, maker.size(), maker);
  put_at(b, 94, static_cast<std::uint16_t>(kHeaderBytes));
  put_at(b, 96, static_cast<std::uint32_t>(b.size() + system_.size() + packing.size()));
  put_at(b, 100,
         static_cast<std::uint32_t>((records == 0 ? 0 : 1) + (system_.empty() ? 0 : 1) + (packing.empty() ? 0 : 1)));
  constexpr int kCompressed = 0x80;
  b[104] = static_cast<char>(point_format() | (packing.empty() ? 0 : kCompressed));
  put_at(b, 105, static_cast<std::uint16_t>(record_bytes_));
  for (std::size_t k = 0; k < 3; ++k) {
    put_at(b, 131 + 8 * k, axes[k].scale);
    put_at(b, 155 + 8 * k, axes[k].offset);
    put_at(b, 179 + 16 * k, axes[k].high);
    put_at(b, 187 + 16 * k, axes[k].low);
  }
  put_at(b, 247, totals.rows);
  for (std::size_t k = 0; k < totals.by_return.size(); ++k) put_at(b, 255 + 8 * k, totals.by_return.at(k));
  if (records == 0) return b + system_ + packing;
  std::size_t at = kHeaderBytes;
  b.replace(at + 2, 9, "LASF_Spec");
  put_at(b, at + 18, std::uint16_t{4});
  put_at(b, at + 20, static_cast<std::uint16_t>(kDescriptorBytes * extras_.size()));
  at += kRecordHeaderBytes;
  for (const LasExtraColumn& extra : extras_) {
    b[at + 2] = static_cast<char>(extra_type(extra.type));
    b.replace(at + 4, extra.name.size(), extra.name);
    at += kDescriptorBytes;
  }
  return b + system_ + packing;
}

void LasLayout::count(const SampleBatch& batch, const std::string& file, LasTotals& totals) const {
  const OwnPlace* returns = nullptr;
  for (const OwnPlace& own : fields_) {
    const LasField& field = own.field;
    if (field.name == "return_number") returns = &own;
    if (field.name == "gps_time") {
      for (std::size_t i = 0; i < batch.size() && !totals.adjusted_times; ++i) {
        const double time = attribute_of(batch, own.attribute, i);
        totals.adjusted_times = time < 0 || time > kSecondsOfWeek;
      }
      continue;
    }
    const auto [lowest, highest] = room_of(field);
    for (std::size_t i = 0; i < batch.size(); ++i) {
      const double value = attribute_of(batch, own.attribute, i) / field.scale;
      const bool is_whole = field.scale != 1 || value == std::floor(value);
      if (is_whole && value >= lowest && value <= highest) continue;
      throw Error(ExitCode::usage,
                  fmt::format("{}: LAS has room for a {} of {} to {}{}, and one is {}; PLY and E57 take any", file,
                              field.name, lowest * field.scale, highest * field.scale,
                              field.scale == 1 ? " without a fraction" : "", value * field.scale));
    }
  }
  for (std::size_t i = 0; i < batch.size(); ++i) {
    const double number = returns == nullptr ? 1 : attribute_of(batch, returns->attribute, i);
    if (number >= 1 && number <= static_cast<double>(totals.by_return.size())) {
      ++totals.by_return.at(static_cast<std::size_t>(number) - 1);
    }
  }
  totals.rows += batch.size();
}

void LasLayout::put_fields(const SampleBatch& batch, std::size_t row, std::byte* record) const {
  constexpr std::byte kOnlyReturn{0x11};
  record[14] = kOnlyReturn;
  for (const OwnPlace& own : fields_) {
    const LasField& field = own.field;
    const double value = attribute_of(batch, own.attribute, row);
    std::byte* to = record + field.offset;
    if (field.bits == 0) {
      put_typed(to, field.stored, field.scale == 1 ? value : std::round(value / field.scale));
      continue;
    }
    const unsigned mask = ((1U << field.bits) - 1) << field.shift;
    *to =
        static_cast<std::byte>((std::to_integer<unsigned>(*to) & ~mask) | static_cast<unsigned>(value) << field.shift);
  }
}

void LasLayout::encode(const SampleBatch& batch, const std::array<LasAxis, 3>& axes, std::size_t first, std::size_t n,
                       std::byte* out) const {
  const std::array<const std::vector<double>*, 3> position{&batch.x, &batch.y, &batch.z};
  for (std::size_t i = first; i < first + n; ++i) {
    std::byte* to = out + (i - first) * record_bytes_;
    std::fill(to, to + record_bytes_, std::byte{});
    for (std::size_t k = 0; k < 3; ++k) {
      store_little(to + 4 * k, to_scalar<std::int32_t>(((*position[k])[i] - axes[k].offset) / axes[k].scale));
    }
    if (intensity_ >= 0) {
      store_little(to + 12, to_scalar<std::uint16_t>(attribute_of(batch, static_cast<std::size_t>(intensity_), i)));
    }
    put_fields(batch, i, to);
    for (std::size_t k = 0; k < 3 && colours_; ++k) {
      const std::size_t a = colour_.at(k);
      store_little(to + las_colour_offset(7) + 2 * k,
                   to_scalar<std::uint16_t>(attribute_of(batch, a, i) * colour_scale(columns_.attributes[a].type)));
    }
    to += las_record_bytes(point_format());
    if (columns_.normals) {
      for (const float v : {batch.nx[i], batch.ny[i], batch.nz[i]}) to = store_little(to, v);
    }
    if (!columns_.radius.empty()) to = store_little(to, batch.radius[i]);
    if (!columns_.quality.empty()) to = store_little(to, batch.quality[i]);
    for (const std::size_t a : others_) to = put_typed(to, columns_.attributes[a].type, attribute_of(batch, a, i));
  }
}

void LasLayout::name_system(const std::string& crs, bool geographic) {
  constexpr std::size_t kMostTextBytes = 65535;
  constexpr std::uint16_t kText = 2112, kKeys = 34735;
  system_text_ = true;
  if (crs.find('[') != std::string::npos && crs.size() + 1 <= kMostTextBytes) {
    system_ = projection_record(kText, crs + '\0');
  } else if (const std::uint16_t number = epsg_number(crs); number != 0) {
    system_ = projection_record(kKeys, geotiff_keys(number, geographic));
    system_text_ = false;
  }
}

}  // namespace lamina
