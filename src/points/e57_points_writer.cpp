// Points to E57 1.0: one scan without a pose.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <limits>
#include <memory>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/number.h"
#include "e57/e57.h"
#include "lamina/error.h"
#include "lamina/run.h"
#include "points/formats.h"
#include "points/point_columns.h"

namespace lamina {
namespace {

constexpr std::size_t kE57SectionHeader = 32;
constexpr std::size_t kE57PacketBytes = 64 << 10;

struct WrittenRange {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  void take(double value) {
    low = std::min(low, value);
    high = std::max(high, value);
  }
};

struct E57OutColumn {
  std::string field;  ///< with the prefix of its extension
  ScalarType type = ScalarType::float32;
  std::size_t offset = 0;  ///< in a row
  WrittenRange values{};
};

std::string escaped(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '<')
      out += "&lt;";
    else if (c == '&')
      out += "&amp;";
    else if (c == '>')
      out += "&gt;";
    else
      out += static_cast<unsigned char>(c) >= ' ' ? c : ' ';
  }
  return out;
}

bool is_element_name(std::string_view name) {
  const auto letter = [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; };
  return !name.empty() && letter(name.front()) && std::all_of(name.begin(), name.end(), [&](char c) {
    return letter(c) || (c >= '0' && c <= '9') || c == '-' || c == '.';
  });
}

/// Fields in the order of RowCodec's rows. Throws Error(internal) for names that are none of XML's.
std::vector<E57OutColumn> e57_out_columns(const PointColumns& columns) {
  std::vector<E57OutColumn> list;
  const ScalarType position = columns.double_positions ? ScalarType::float64 : ScalarType::float32;
  for (const char* name : {"cartesianX", "cartesianY", "cartesianZ"}) list.push_back({name, position});
  if (columns.normals) {
    for (const char* name : {"nor:normalX", "nor:normalY", "nor:normalZ"}) list.push_back({name});
  }
  std::set<std::string> seen{"x", "y", "z", "nx", "ny", "nz"};
  const auto add = [&](const std::string& name, ScalarType type) {
    if (!is_element_name(name) || !seen.insert(name).second) {
      throw Error(ExitCode::internal,
                  fmt::format("column '{}' cannot be written to an E57: its name is empty, has other signs than "
                              "letters, digits, _ - and ., or is there twice",
                              name));
    }
    list.push_back({"lam:" + name, type});
  };
  if (!columns.radius.empty()) add(columns.radius, ScalarType::float32);
  if (!columns.quality.empty()) add(columns.quality, ScalarType::float32);
  const auto has = [&](const char* name) { return find_attribute(columns.attributes, name).has_value(); };
  const bool colours = has("red") && has("green") && has("blue");
  for (const AttributeSpec& spec : columns.attributes) {
    add(spec.name, spec.type);
    if (spec.name == "intensity") list.back().field = "intensity";
    if (colours && spec.name == "red") list.back().field = "colorRed";
    if (colours && spec.name == "green") list.back().field = "colorGreen";
    if (colours && spec.name == "blue") list.back().field = "colorBlue";
  }
  std::size_t offset = 0;
  for (E57OutColumn& column : list) {
    column.offset = offset;
    offset += static_cast<std::size_t>(byte_size(column.type));
  }
  return list;
}

/// The full range of 8 and 16 bits, 0 to 1 of floats within; otherwise nothing is known.
std::string limits_text(const E57OutColumn& column) {
  const bool unit = !is_integer_type(column.type) && column.values.low >= 0 && column.values.high <= 1;
  const int full = column.type == ScalarType::uint8 ? 255 : column.type == ScalarType::uint16 ? 65535 : unit ? 1 : 0;
  if (full == 0) return {};
  const char* type = unit ? "Float" : "Integer";
  return fmt::format("<{0}Minimum type=\"{1}\">0</{0}Minimum>\n<{0}Maximum type=\"{1}\">{2}</{0}Maximum>\n",
                     column.field, type, full);
}

std::string prototype_line(const E57OutColumn& column) {
  if (column.type == ScalarType::float64) return fmt::format("<{} type=\"Float\"/>\n", column.field);
  if (column.type == ScalarType::float32) {
    return fmt::format("<{} type=\"Float\" precision=\"single\"/>\n", column.field);
  }
  return with_scalar_type(column.type, [&](auto zero) {
    using Limits = std::numeric_limits<decltype(zero)>;
    return fmt::format("<{} type=\"Integer\" minimum=\"{}\" maximum=\"{}\"/>\n", column.field,
                       static_cast<std::int64_t>(Limits::lowest()), static_cast<std::int64_t>(Limits::max()));
  });
}

/// A name made from the contents.
std::string guid(std::uint64_t hash, unsigned which) {
  const std::uint64_t a = (hash + which) * 0xBF58476D1CE4E5B9ULL;
  const std::uint64_t b = (a ^ (a >> 31U)) * 0x94D049BB133111EBULL;
  return fmt::format("{{{:08x}-{:04x}-8{:03x}-8{:03x}-{:012x}}}", a >> 32U, (a >> 16U) & 0xFFFFU, a & 0xFFFU, b >> 52U,
                     b & 0xFFFFFFFFFFFFULL);
}

class E57PointsWriter final : public PointsWriter {
 public:
  E57PointsWriter(const std::string& path, const PointColumns& columns, const PointsWriterSettings& settings)
      : PointsWriter(columns),
        settings_(settings),
        out_(e57_out_columns(columns)),
        codec_(columns),
        rows_out_(path, settings, false) {
    const std::size_t header = packet_header();
    if (header + codec_.row_bytes() + 3 > kE57PacketBytes) {
      throw Error(ExitCode::internal, fmt::format("{} columns are more than an E57 can hold", out_.size()));
    }
    most_ = (kE57PacketBytes - header - 3) / codec_.row_bytes();
    waiting_.resize(most_ * codec_.row_bytes());
    const std::vector<std::byte> zeros(e57::kFileHeaderBytes + kE57SectionHeader);
    write(zeros);
  }

  void append(const SampleBatch& batch) override {
    rows_out_.require_open();
    codec_.require_writable(batch, rows_, rows_out_.name());
    for (std::size_t first = 0; first < batch.size();) {
      const std::size_t n = std::min(most_ - waiting_rows_, batch.size() - first);
      codec_.encode(batch, first, n, waiting_.data() + waiting_rows_ * codec_.row_bytes());
      waiting_rows_ += n;
      first += n;
      if (waiting_rows_ == most_) write_packet();
    }
    rows_ += batch.size();
  }

  void commit() override {
    rows_out_.require_all(rows_);
    if (waiting_rows_ > 0) write_packet();
    write_index();
    const std::uint64_t section = pages_.payload() - e57::kFileHeaderBytes;
    const std::string text = xml();
    const std::uint64_t at = pages_.payload();
    write(std::as_bytes(std::span(text)));
    rows_out_.check(pages_.finish(rows_out_.fd()));
    put_headers(section, at, text.size());
    rows_out_.publish(pages_.first_page(), pages_.pages() * e57::kPageBytes);
  }

 private:
  [[nodiscard]] std::size_t packet_header() const { return 6 + 2 * out_.size(); }

  void write(std::span<const std::byte> bytes) { rows_out_.check(pages_.append(rows_out_.fd(), bytes)); }

  /// The rows that wait, column by column. Integers count from their type's lowest: of signed ones, that turns the
  /// highest bit.
  void write_packet() {
    const std::size_t row_bytes = codec_.row_bytes();
    const std::size_t used = packet_header() + waiting_rows_ * row_bytes;
    std::vector<std::byte> packet((used + 3) / 4 * 4);
    std::byte* at = packet.data();
    *at++ = std::byte{1};
    *at++ = std::byte{0};
    at = store_little(at, static_cast<std::uint16_t>(packet.size() - 1));
    at = store_little(at, static_cast<std::uint16_t>(out_.size()));
    for (const E57OutColumn& column : out_) {
      at = store_little(at,
                        static_cast<std::uint16_t>(waiting_rows_ * static_cast<std::size_t>(byte_size(column.type))));
    }
    for (E57OutColumn& column : out_) {
      with_scalar_type(column.type, [&](auto zero) {
        using T = decltype(zero);
        constexpr bool kSigned = std::numeric_limits<T>::is_integer && std::numeric_limits<T>::is_signed;
        const std::byte* from = waiting_.data() + column.offset;
        for (std::size_t i = 0; i < waiting_rows_; ++i, from += row_bytes) {
          const auto value = load_little<T>(from);
          column.values.take(static_cast<double>(value));
          at = store_little(at, value);
          if constexpr (kSigned) at[-1] ^= std::byte{0x80};
        }
      });
    }
    write(packet);
    waiting_rows_ = 0;
  }

  /// Other readers want an index, if only of the first packet.
  void write_index() {
    if (rows_ == 0) return;
    index_ = pages_.payload();
    std::array<std::byte, 32> packet{};
    store_little(packet.data() + 2, static_cast<std::uint16_t>(packet.size() - 1));
    store_little(packet.data() + 4, std::uint16_t{1});
    store_little(packet.data() + 24, e57::file_offset(e57::kFileHeaderBytes + kE57SectionHeader));
    write(packet);
  }

  void put_headers(std::uint64_t section, std::uint64_t xml, std::uint64_t xml_bytes) {
    std::array<std::byte, e57::kFileHeaderBytes> file{};
    std::memcpy(file.data(), "ASTM-E57", 8);
    store_little(file.data() + 8, std::uint32_t{1});
    store_little(file.data() + 16, pages_.pages() * e57::kPageBytes);
    store_little(file.data() + 24, e57::file_offset(xml));
    store_little(file.data() + 32, xml_bytes);
    store_little(file.data() + 40, std::uint64_t{e57::kPageBytes});
    pages_.put(0, file);
    std::array<std::byte, kE57SectionHeader> points{std::byte{1}};
    store_little(points.data() + 8, section);
    store_little(points.data() + 16, e57::file_offset(e57::kFileHeaderBytes + kE57SectionHeader));
    store_little(points.data() + 24, index_ == 0 ? index_ : e57::file_offset(index_));
    pages_.put(e57::kFileHeaderBytes, points);
  }

  [[nodiscard]] std::string xml() const {
    std::string text = fmt::format(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
        "<e57Root type=\"Structure\" xmlns=\"http://www.astm.org/COMMIT/E57/2010-e57-v1.0\" "
        "xmlns:nor=\"http://www.libe57.org/E57_NOR_surface_normals.txt\" xmlns:lam=\"urn:x-lamina:point-attributes\">\n"
        "<formatName type=\"String\">ASTM E57 3D Imaging Data File</formatName>\n"
        "<guid type=\"String\">{}</guid>\n"
        "<versionMajor type=\"Integer\">1</versionMajor>\n<versionMinor type=\"Integer\">0</versionMinor>\n"
        "<e57LibraryVersion type=\"String\">lamina {}</e57LibraryVersion>\n"
        "<coordinateMetadata type=\"String\">{}</coordinateMetadata>\n"
        "<data3D type=\"Vector\" allowHeterogeneousChildren=\"1\">\n<vectorChild type=\"Structure\">\n"
        "<guid type=\"String\">{}</guid>\n<name type=\"String\">points</name>\n",
        guid(pages_.hash() + rows_, 1), version(), escaped(settings_.crs), guid(pages_.hash() + rows_, 2));
    if (!settings_.comments.empty()) {
      std::string all;
      for (const std::string& comment : settings_.comments) all += (all.empty() ? "" : "; ") + escaped(comment);
      text += fmt::format("<description type=\"String\">{}</description>\n", all);
    }
    if (rows_ > 0) {
      text += "<cartesianBounds type=\"Structure\">\n";
      for (std::size_t k = 0; k < 3; ++k) {
        text +=
            fmt::format("<{0}Minimum type=\"Float\">{1}</{0}Minimum>\n<{0}Maximum type=\"Float\">{2}</{0}Maximum>\n",
                        "xyz"[k], out_[k].values.low, out_[k].values.high);
      }
      text += "</cartesianBounds>\n";
    }
    std::string intensity;
    std::string colours;
    for (const E57OutColumn& column : out_) {
      if (column.field == "intensity") intensity = limits_text(column);
      if (column.field.starts_with("color")) colours += limits_text(column);
    }
    if (!intensity.empty()) {
      text += "<intensityLimits type=\"Structure\">\n" + intensity + "</intensityLimits>\n";
    }
    if (!colours.empty()) text += "<colorLimits type=\"Structure\">\n" + colours + "</colorLimits>\n";
    text += fmt::format(
        "<points type=\"CompressedVector\" fileOffset=\"{}\" recordCount=\"{}\">\n"
        "<prototype type=\"Structure\">\n",
        e57::kFileHeaderBytes, rows_);
    for (const E57OutColumn& column : out_) text += prototype_line(column);
    return text +
           "</prototype>\n<codecs type=\"Vector\" allowHeterogeneousChildren=\"1\">\n</codecs>\n</points>\n"
           "</vectorChild>\n</data3D>\n<images2D type=\"Vector\" allowHeterogeneousChildren=\"1\">\n</images2D>\n"
           "</e57Root>\n";
  }

  PointsWriterSettings settings_;
  std::vector<E57OutColumn> out_;
  RowCodec codec_;
  StagedRows rows_out_;
  e57::PageWriter pages_;
  std::size_t most_ = 0;            ///< rows of a packet
  std::vector<std::byte> waiting_;  ///< rows of the next packet
  std::size_t waiting_rows_ = 0;
  std::uint64_t index_ = 0;  ///< payload offset; 0: none
};

}  // namespace

std::unique_ptr<PointsWriter> open_e57_points_writer(const std::string& path, const PointColumns& columns,
                                                     const PointsWriterSettings& settings) {
  return std::make_unique<E57PointsWriter>(path, columns, settings);
}

}  // namespace lamina
