// PCD of any encoding.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <optional>

#include "base/number.h"
#include "lamina/error.h"
#include "points/formats.h"
#include "points/input_file.h"
#include "points/pcd_header.h"
#include "points/point_columns.h"
#include "points/scans.h"
#include "points/text_rows.h"

namespace lamina {
namespace {

/// A packed colour as text: the number's bits, or the number itself where the header calls it an integer or it cannot
/// be anything else.
std::uint32_t unpack_colour(double value, const PcdField& field) {
  const bool integer = field.type != ScalarType::float32 || (value >= 1 && value < 0x1p24);
  if (integer && value < 0) return value >= -0x1p31 ? static_cast<std::uint32_t>(static_cast<std::int32_t>(value)) : 0;
  if (integer) return value < 0x1p32 ? static_cast<std::uint32_t>(value) : 0;
  return std::bit_cast<std::uint32_t>(static_cast<float>(value));
}

class AsciiPcd final : public PointSource {
 public:
  AsciiPcd(InputFile file, const PcdHeader& header, PointSourceInfo info) : file_(std::move(file)) {
    info_ = std::move(info);
    info_.random_access = true;
    std::vector<PointColumn> columns;
    std::vector<PointColumn> known;
    for (const PcdField& field : header.fields) {
      PointColumn column{field.name, field.type.value_or(ScalarType::float32)};
      if (is_packed(field) && !packed_) {
        packed_ = {columns.size(), field};
        column = {"-", ScalarType::float64};
      }
      if (field.name == "_" || field.count != 1 || !field.type || is_packed(field)) column.role = Role::skipped;
      columns.insert(columns.end(), field.count, column);
      if (column.role != Role::skipped) known.push_back(column);
    }
    const std::size_t own = columns.size();
    if (packed_) {
      for (std::size_t k = 0; k < pcd_channels(packed_->field); ++k) {
        const char* name = kPcdChannels[k < 3 ? 2 - k : k];
        PointColumn channel{name, ScalarType::uint8};
        if (has_column(known, name)) channel.role = Role::skipped;
        columns.push_back(channel);
      }
    }
    give_roles(columns, info_, file_.name, "field");
    channels_.assign(columns.begin() + static_cast<std::ptrdiff_t>(own), columns.end());
    columns.resize(own);
    parser_.emplace(std::move(columns), kBlanks, "");
    index_rows(header);
  }

  void read(std::uint64_t first, std::size_t count, SampleBatch& out) override {
    const RowRange rows = rows_there(info_, first, count);
    std::vector<PointColumn> columns = parser_->columns();
    const std::size_t own = columns.size();
    columns.insert(columns.end(), channels_.begin(), channels_.end());
    std::vector<ColumnTarget> targets = prepare_batch(info_, columns, rows, out);
    const std::vector<ColumnTarget> channels(targets.begin() + static_cast<std::ptrdiff_t>(own), targets.end());
    targets.resize(own);
    std::vector<double> colours(packed_ ? rows.count : 0);
    if (packed_) targets[packed_->column] = {.wide = colours.data()};
    for_rows(
        file_, '\n', rows_, rows, [](std::string_view) { return true; },
        [&](std::string_view line, std::uint64_t number, std::size_t i) {
          parser_->parse(file_, line, number, i, targets);
        });
    round_exact_attributes(out);
    for (std::size_t i = 0; i < colours.size(); ++i) {
      const std::uint32_t colour = unpack_colour(colours[i], packed_->field);
      for (std::size_t k = 0; k < channels.size(); ++k) {
        const std::size_t byte = k < 3 ? 2 - k : k;
        if (channels[k].narrow != nullptr) channels[k].narrow[i] = static_cast<float>((colour >> (8 * byte)) & 255U);
      }
    }
  }

 private:
  struct Packed {
    std::size_t column;
    PcdField field;
  };

  void index_rows(const PcdHeader& header) {
    LineReader lines(file_, header.bytes, header.lines, '\n');
    std::string_view line;
    while (lines.next(line)) rows_.add(lines);
    if (rows_.count() != header.points) {
      throw Error(ExitCode::unreadable,
                  fmt::format("{}: the header promises {} points, the file holds {} lines of them (to line "
                              "{}): it was cut short or the header's count is wrong",
                              file_.name, header.points, rows_.count(), lines.line()));
    }
  }

  InputFile file_;
  std::optional<RowParser> parser_;
  std::optional<Packed> packed_;
  std::vector<PointColumn> channels_;  ///< what a packed colour comes apart into, red first
  RowIndex rows_;
};

struct BinaryColumns {
  std::vector<PointColumn> columns;      ///< offsets from the beginning of a point
  std::vector<std::size_t> field_begin;  ///< of the field a column is part of
  std::vector<std::size_t> field_bytes;
};

BinaryColumns binary_columns(const PcdHeader& header) {
  BinaryColumns found;
  std::vector<PointColumn>& columns = found.columns;
  std::size_t offset = 0;
  for (const PcdField& field : header.fields) {
    if (is_packed(field)) {
      for (std::size_t k = 0; k < pcd_channels(field); ++k) {
        const std::size_t channel = k < 3 ? 2 - k : k;  // red first
        if (!has_column(columns, kPcdChannels[channel]))
          columns.push_back({kPcdChannels[channel], ScalarType::uint8, offset + channel});
      }
    } else if (field.name != "_" && field.count == 1 && field.type) {
      columns.push_back({field.name, *field.type, offset});
    }
    found.field_begin.resize(columns.size(), offset);
    found.field_bytes.resize(columns.size(), field.bytes);
    offset += field.bytes * field.count;
  }
  return found;
}

void remark(const PcdHeader& header, const std::string& name, PointSourceInfo& info) {
  std::string left_out;
  for (const PcdField& field : header.fields) {
    if (field.name != "_" && (field.count != 1 || !field.type))
      left_out += (left_out.empty() ? "" : ", ") + quoted_word(field.name);
  }
  if (!left_out.empty())
    info.remarks.push_back(fmt::format("{}: fields left out: {} (several values, or 64-bit integers)", name, left_out));
  if (header.has_viewpoint)
    info.remarks.push_back(
        fmt::format("{}: points are taken as they stand; the file's VIEWPOINT is not applied", name));
}

void require_size(const InputFile& file, std::uint64_t have, std::uint64_t points, std::size_t point_bytes) {
  if (points > have / point_bytes) {
    throw Error(
        ExitCode::unreadable,
        fmt::format("{}: the header promises {} points, the file holds {} of {} bytes each: it was cut short or the "
                    "header's count is wrong",
                    file.name, points, have / point_bytes, point_bytes));
  }
  // Nothing but a wrong count leaves more than a rest of padding.
  constexpr std::uint64_t kPadding = 4096;
  if (have - points * point_bytes > kPadding) {
    throw Error(ExitCode::unreadable,
                fmt::format("{}: {} bytes follow the last point the header promises: a count or a field "
                            "in the header is wrong",
                            file.name, have - points * point_bytes));
  }
}

class BinaryPcd final : public PointSource {
 public:
  BinaryPcd(InputFile file, const PcdHeader& header, PointSourceInfo info) : file_(std::move(file)) {
    layout_ = {header.bytes, header.point_bytes(), false};
    require_size(file_, file_.bytes - header.bytes, header.points, layout_.stride);
    columns_ = binary_columns(header).columns;
    info_ = std::move(info);
    info_.random_access = true;
    give_roles(columns_, info_, file_.name, "field");
  }

  void read(std::uint64_t first, std::size_t count, SampleBatch& out) override {
    const RowRange rows = rows_there(info_, first, count);
    read_binary_rows(file_, layout_, columns_, rows, prepare_batch(info_, columns_, rows, out));
    round_exact_attributes(out);
  }

 private:
  InputFile file_;
  BinaryRows layout_;
  std::vector<PointColumn> columns_;
};

/// Unpacked, the values lie field by field: each column is a file of its own, so to speak.
class CompressedPcd final : public PointSource {
 public:
  CompressedPcd(const InputFile& file, const PcdHeader& header, PointSourceInfo info, const std::string& tmp_dir)
      : file_(unpack(file, header, tmp_dir)) {
    BinaryColumns found = binary_columns(header);
    columns_ = std::move(found.columns);
    for (std::size_t c = 0; c < columns_.size(); ++c) {
      layouts_.push_back({found.field_begin[c] * header.points, found.field_bytes[c], false});
      columns_[c].offset -= found.field_begin[c];
    }
    info_ = std::move(info);
    info_.random_access = true;
    give_roles(columns_, info_, file_.name, "field");
  }

  void read(std::uint64_t first, std::size_t count, SampleBatch& out) override {
    const RowRange rows = rows_there(info_, first, count);
    const std::vector<ColumnTarget> targets = prepare_batch(info_, columns_, rows, out);
    for (std::size_t c = 0; c < columns_.size(); ++c) {
      read_binary_rows(file_, layouts_[c], {columns_[c]}, rows, {targets[c]});
    }
    round_exact_attributes(out);
  }

 private:
  static InputFile unpack(const InputFile& file, const PcdHeader& header, const std::string& tmp_dir) {
    std::array<std::byte, 8> sizes{};
    if (file.read(header.bytes, sizes.data(), sizes.size()) < sizes.size()) {
      throw Error(ExitCode::unreadable, fmt::format("{}: ends before the compressed data", file.name));
    }
    const auto packed = load_little<std::uint32_t>(sizes.data());
    const auto unpacked = load_little<std::uint32_t>(sizes.data() + 4);
    const std::uint64_t begin = header.bytes + sizes.size();
    if (packed > file.bytes - begin) {
      throw Error(ExitCode::unreadable,
                  fmt::format("{}: {} bytes of compressed data promised (at byte {}), the file holds {}: "
                              "it was cut short",
                              file.name, packed, header.bytes, file.bytes - begin));
    }
    const std::size_t point_bytes = header.point_bytes();
    if (unpacked / point_bytes != header.points || unpacked % point_bytes != 0) {
      throw Error(
          ExitCode::unreadable,
          fmt::format("{}: {} points of {} bytes are promised, but the data unpack to {} (at byte {}): a number in "
                      "the header is wrong",
                      file.name, header.points, point_bytes, unpacked, header.bytes + 4));
    }
    Spool spool(file.name, tmp_dir);
    unpack_lzf(file, begin, packed, unpacked, spool);
    return spool.finish();
  }

  InputFile file_;
  std::vector<PointColumn> columns_;
  std::vector<BinaryRows> layouts_;
};

std::unique_ptr<PointSource> open_encoded(InputFile file, const PcdHeader& header, PointSourceInfo info,
                                          const std::string& tmp_dir) {
  switch (header.data) {
    case PcdData::ascii:
      return std::make_unique<AsciiPcd>(std::move(file), header, std::move(info));
    case PcdData::binary:
      return std::make_unique<BinaryPcd>(std::move(file), header, std::move(info));
    case PcdData::binary_compressed:
      break;
  }
  return std::make_unique<CompressedPcd>(file, header, std::move(info), tmp_dir);
}

}  // namespace

std::unique_ptr<PointSource> open_pcd(InputFile file, const std::string& path, const std::string& tmp_dir) {
  std::string start(static_cast<std::size_t>(std::min<std::uint64_t>(file.bytes, kSniffBytes)), '\0');
  start.resize(file.read(0, start.data(), start.size()));
  const PcdHeader header = parse_pcd_header(start, file.name);
  PointSourceInfo info;
  info.path = path;
  info.count = header.points;
  remark(header, file.name, info);
  // An organised cloud is a sensor's picture, taken from where its coordinates begin unless VIEWPOINT has another
  // place.
  if (header.width > 0 && !header.is_moved) info.scans = {{0, ScanPart::Scanner::position, {0, 0, 0}}};
  std::unique_ptr<PointSource> source = open_encoded(std::move(file), header, std::move(info), tmp_dir);
  // Rows are known to be there by now; all places have one, of which some are not finite.
  if (header.width == 0 || source->info().count != header.points) return source;
  const auto grid = std::make_shared<ScanGrid>(header.width);
  for (std::uint64_t row = 0; row < header.points; ++row) grid->add(true);
  return organised_points(std::move(source), grid);
}

}  // namespace lamina
