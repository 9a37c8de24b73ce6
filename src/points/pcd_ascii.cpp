#include "points/pcd_ascii.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <optional>

#include "lamina/error.h"
#include "points/row_parser.h"
#include "points/text_file.h"

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
    first = std::min(first, info_.count);
    count = static_cast<std::size_t>(std::min<std::uint64_t>(count, info_.count - first));
    std::vector<PointColumn> columns = parser_->columns();
    const std::size_t own = columns.size();
    columns.insert(columns.end(), channels_.begin(), channels_.end());
    std::vector<ColumnTarget> targets = prepare_batch(info_, columns, first, count, out);
    const std::vector<ColumnTarget> channels(targets.begin() + static_cast<std::ptrdiff_t>(own), targets.end());
    targets.resize(own);
    std::vector<double> colours(packed_ ? count : 0);
    if (packed_) targets[packed_->column] = {.wide = colours.data()};
    for_rows(
        file_, '\n', rows_, first, count, [](std::string_view) { return true; },
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

}  // namespace

std::unique_ptr<PointSource> open_ascii_pcd(InputFile file, const PcdHeader& header, PointSourceInfo info) {
  return std::make_unique<AsciiPcd>(std::move(file), header, std::move(info));
}

}  // namespace lamina
