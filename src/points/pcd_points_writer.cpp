#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <set>
#include <string_view>

#include "base/descriptor.h"
#include "base/spill_file.h"
#include "lamina/error.h"
#include "points/formats.h"
#include "points/point_columns.h"

namespace lamina {
namespace {

/// Where red, green and blue stand among the attributes, when all three are there in 8 bits, or in 16.
struct Channels {
  std::array<std::size_t, 3> at{};
  double scale = 1;  ///< to 8 bits, which is all that the format's colours have
};
using Colours = std::optional<Channels>;

Colours channels_of(const AttributeLayout& layout, ScalarType type, double scale) {
  constexpr std::array kNames{"red", "green", "blue"};
  Channels found{{}, scale};
  for (std::size_t k = 0; k < 3; ++k) {
    const auto at = std::find(layout.begin(), layout.end(), AttributeSpec{kNames.at(k), type});
    if (at == layout.end()) return std::nullopt;
    found.at.at(k) = static_cast<std::size_t>(at - layout.begin());
  }
  return found;
}

Colours colours_of(const AttributeLayout& layout) {
  const Colours bytes = channels_of(layout, ScalarType::uint8, 1);
  return bytes ? bytes : channels_of(layout, ScalarType::uint16, 1 / 257.0);
}

bool is_one_of(const Channels& colours, std::size_t attribute) {
  return std::find(colours.at.begin(), colours.at.end(), attribute) != colours.at.end();
}

/// Columns as they are stored: the packed colour is an integer behind the other attributes.
PointColumns stored(const PointColumns& columns, const Colours& colours) {
  PointColumns out = columns;
  if (!colours) return out;
  out.attributes.clear();
  for (std::size_t a = 0; a < columns.attributes.size(); ++a) {
    if (!is_one_of(*colours, a)) out.attributes.push_back(columns.attributes[a]);
  }
  out.attributes.push_back({"rgb", ScalarType::uint32});
  return out;
}

char type_letter(ScalarType type) {
  switch (type) {
    case ScalarType::int8:
    case ScalarType::int16:
    case ScalarType::int32:
      return 'I';
    case ScalarType::uint8:
    case ScalarType::uint16:
    case ScalarType::uint32:
      return 'U';
    default:
      return 'F';
  }
}

/// The header for `count` points, of the same length whatever the count.
std::string header_of(const PointColumns& columns, std::uint64_t count, bool packed) {
  AttributeLayout fields;
  const ScalarType position = columns.double_positions ? ScalarType::float64 : ScalarType::float32;
  for (const char* axis : {"x", "y", "z"}) fields.push_back({axis, position});
  if (columns.normals) {
    for (const char* axis : {"normal_x", "normal_y", "normal_z"}) fields.push_back({axis, ScalarType::float32});
  }
  if (!columns.radius.empty()) fields.push_back({columns.radius, ScalarType::float32});
  if (!columns.quality.empty()) fields.push_back({columns.quality, ScalarType::float32});
  fields.insert(fields.end(), columns.attributes.begin(), columns.attributes.end());
  std::set<std::string_view> seen;
  std::string names;
  std::string sizes;
  std::string types;
  std::string counts;
  for (const AttributeSpec& field : fields) {
    const bool plain =
        !field.name.empty() && field.name != "_" && field.name.find_first_of(" \t\r\n\v\f") == std::string::npos;
    if (!plain || !seen.insert(field.name).second) {
      throw Error(ExitCode::internal,
                  fmt::format("column '{}' cannot be written to a PCD: its name is empty, has blanks, or is "
                              "there twice",
                              field.name));
    }
    names += " " + field.name;
    sizes += fmt::format(" {}", byte_size(field.type));
    types += fmt::format(" {}", packed && field.name == "rgb" ? 'F' : type_letter(field.type));
    counts += " 1";
  }
  const std::string digits = fmt::format("{}", count);
  const std::string padding(
      2 * (static_cast<std::size_t>(std::numeric_limits<std::uint64_t>::digits10) + 1 - digits.size()), '-');
  return fmt::format(
      "# .PCD v0.7 - Point Cloud Data file format\n# {}\nVERSION 0.7\nFIELDS{}\nSIZE{}\nTYPE{}\nCOUNT{}\nWIDTH "
      "{}\nHEIGHT "
      "1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {}\nDATA binary\n",
      padding, names, sizes, types, counts, digits, digits);
}

class PcdPointsWriter final : public PointsWriter {
 public:
  PcdPointsWriter(const std::string& path, const PointColumns& columns, const PointsWriterSettings& settings)
      : PointsWriter(columns),
        settings_(settings),
        colours_(colours_of(columns.attributes)),
        stored_(stored(columns, colours_)),
        header_bytes_(header_of(stored_, 0, colours_.has_value()).size()),
        given_(columns),
        codec_(stored_),
        rows_out_(path, settings, settings.count.has_value()),
        writer_(codec_.row_bytes()) {
    const std::string header = header_of(stored_, settings_.count.value_or(0), colours_.has_value());
    rows_out_.check(write_all(rows_out_.fd(), header.data(), header.size()));
  }

  void append(const SampleBatch& batch) override {
    rows_out_.require_open();
    given_.require_writable(batch, rows_, rows_out_.name());
    const SampleBatch& rows = colours_ ? packed(batch) : batch;
    rows_out_.check(writer_.append(rows_out_.fd(), rows.size(), [&](std::byte* to, std::size_t first, std::size_t n) {
      codec_.encode(rows, first, n, to);
    }));
    rows_ += batch.size();
  }

  void commit() override {
    rows_out_.require_all(rows_);
    rows_out_.check(writer_.flush(rows_out_.fd()));
    rows_out_.publish(header_of(stored_, rows_, colours_.has_value()), header_bytes_ + writer_.written());
  }

 private:
  const SampleBatch& packed(const SampleBatch& batch) {
    SampleBatch& out = packed_;
    out.x = batch.x, out.y = batch.y, out.z = batch.z;
    out.nx = batch.nx, out.ny = batch.ny, out.nz = batch.nz;
    out.radius = batch.radius;
    out.quality = batch.quality;
    out.attributes.clear();
    out.exact.clear();
    for (std::size_t a = 0; a < batch.attributes.size(); ++a) {
      if (is_one_of(*colours_, a)) continue;
      out.attributes.push_back(batch.attributes[a]);
      out.exact.push_back(a < batch.exact.size() ? batch.exact[a] : std::vector<double>{});
    }
    std::vector<double> colour(batch.size());
    for (const std::size_t a : colours_->at) {
      for (std::size_t i = 0; i < batch.size(); ++i) {
        colour[i] = colour[i] * 256 + std::clamp(std::nearbyint(colours_->scale * batch.attributes[a][i]), 0.0, 255.0);
      }
    }
    out.attributes.emplace_back(colour.begin(), colour.end());
    out.exact.push_back(std::move(colour));
    return out;
  }

  PointsWriterSettings settings_;
  Colours colours_;
  PointColumns stored_;
  std::size_t header_bytes_;
  RowCodec given_, codec_;
  StagedRows rows_out_;
  SoleRecordWriter writer_;
  SampleBatch packed_;
};

}  // namespace

std::unique_ptr<PointsWriter> open_pcd_points_writer(const std::string& path, const PointColumns& columns,
                                                     const PointsWriterSettings& settings) {
  return std::make_unique<PcdPointsWriter>(path, columns, settings);
}

}  // namespace lamina
