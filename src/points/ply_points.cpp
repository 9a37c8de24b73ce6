// PLY of any encoding.
#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <string_view>
#include <utility>
#include <vector>

#include "base/descriptor.h"
#include "base/number.h"
#include "base/spill_file.h"
#include "lamina/error.h"
#include "lamina/run.h"
#include "points/formats.h"
#include "points/ply_header.h"
#include "points/point_columns.h"
#include "points/text_rows.h"

namespace lamina {
namespace {

/// Both byte orders: random access from any thread.
class BinaryPly final : public PointSource {
 public:
  BinaryPly(InputFile file, const PlyHeader& header, PlyRows rows)
      : file_(std::move(file)),
        columns_(std::move(rows.columns)),
        layout_{locate_element(file_, header, rows.element), rows.stride, is_swapped(header.format)} {
    info_ = std::move(rows.info);
    info_.random_access = true;
  }

  void read(std::uint64_t first, std::size_t count, SampleBatch& out) override {
    const RowRange rows = rows_there(info_, first, count);
    const std::vector<ColumnTarget> targets = prepare_batch(info_, columns_, rows, out);
    read_binary_rows(file_, layout_, columns_, rows, targets);
    round_exact_attributes(out);
  }

 private:
  InputFile file_;
  std::vector<PointColumn> columns_;
  BinaryRows layout_;
};

/// One row a line, read in order. Counts that the file is too small for are refused, whatever its rows look like.
class AsciiPly final : public PointSource {
 public:
  AsciiPly(InputFile file, PlyHeader header, PlyRows rows)
      : file_(std::move(file)), header_(std::move(header)), rows_(std::move(rows)), lines_(start()) {
    info_ = rows_.info;
    require_plausible_counts();
    rewind();
    if (info_.count == 0) require_rest();
  }

  void read(std::uint64_t first, std::size_t count, SampleBatch& out) override {
    first = std::min(first, info_.count);
    if (first == 0 && next_ != 0) rewind();
    if (first != next_) {
      throw Error(ExitCode::internal, fmt::format("{}: an ascii file is read in order: row {} asked for, {} is next",
                                                  file_.name, first, next_));
    }
    count = static_cast<std::size_t>(std::min<std::uint64_t>(count, info_.count - first));
    const std::vector<ColumnTarget> targets = prepare_batch(info_, rows_.columns, {first, count}, out);
    for (std::size_t i = 0; i < count; ++i) {
      std::string_view line;
      if (!lines_.next(line)) {
        report_short_file(file_.name, "vertex", info_.count, fmt::format("{} (to line {})", next_, lines_.line()));
      }
      parse_row(line, i, targets);
      ++next_;
    }
    round_exact_attributes(out);
    if (next_ == info_.count) require_rest();
  }

 private:
  [[nodiscard]] LineReader start() const { return {file_, header_.bytes, header_.lines, header_.line_end}; }

  [[noreturn]] void fail(const std::string& what) const {
    throw Error(ExitCode::unreadable,
                fmt::format("{}, line {} (vertex {}): {}", file_.name, lines_.line(), next_, what));
  }

  /// A value takes at least a digit and a blank, the file's last one the digit alone: bounds what a reader may believe
  /// about the counts before it has seen the rows.
  void require_plausible_counts() const {
    const std::uint64_t bytes = file_.bytes - header_.bytes + 1;
    for (const PlyElement& element : header_.elements) {
      const std::uint64_t least = 2 * element.properties.size();
      if (least != 0 && element.count > bytes / least) {
        report_short_file(file_.name, element.name, element.count, fmt::format("at most {}", bytes / least));
      }
    }
  }

  void skip_rows(const PlyElement& element) {
    std::string_view line;
    if (element.properties.empty()) return;
    for (std::uint64_t row = 0; row < element.count; ++row) {
      if (!lines_.next(line)) {
        report_short_file(file_.name, element.name, element.count, fmt::format("{} (to line {})", row, lines_.line()));
      }
    }
  }

  void rewind() {
    lines_ = start();
    next_ = 0;
    for (std::size_t i = 0; i < rows_.element; ++i) skip_rows(header_.elements[i]);
  }

  /// After the last vertex: the elements behind must be there, and nothing else. Once is enough.
  void require_rest() {
    if (rest_seen_) return;
    rest_seen_ = true;
    for (std::size_t i = rows_.element + 1; i < header_.elements.size(); ++i) skip_rows(header_.elements[i]);
    std::string_view line;
    if (lines_.next(line)) {
      throw Error(
          ExitCode::unreadable,
          fmt::format("{}, line {}: more rows than the header promises ({} of element 'vertex'): a count in the "
                      "header is wrong",
                      file_.name, lines_.line(), info_.count));
    }
  }

  void parse_row(std::string_view line, std::size_t at, const std::vector<ColumnTarget>& targets) const {
    const char* p = line.data();
    const char* end = p + line.size();
    for (std::size_t c = 0; c < targets.size(); ++c) {
      while (p != end && is_space(*p)) ++p;
      double value = 0;
      const char* stop = p == end ? nullptr : parse_number(p, end, value);
      if (stop == nullptr || (stop != end && !is_space(*stop))) bad_value(p, end, c);
      if (is_integer_type(rows_.columns[c].type)) require_type(value, p, stop, rows_.columns[c]);
      if (targets[c].wide != nullptr) {
        targets[c].wide[at] = value;
      } else {
        targets[c].narrow[at] = static_cast<float>(value);
      }
      p = stop;
    }
    while (p != end && is_space(*p)) ++p;
    if (p != end)
      fail(fmt::format("{} values expected, more stand there, from {} on", targets.size(), quoted_word(word(p, end))));
  }

  static std::string_view word(const char* p, const char* end) {
    return {p, static_cast<std::size_t>(std::find_if(p, end, is_space) - p)};
  }

  [[noreturn]] void bad_value(const char* p, const char* end, std::size_t column) const {
    const std::string& name = rows_.columns[column].name;
    if (p == end) {
      fail(fmt::format("{} values expected, only {} stand there ({} is missing)", rows_.columns.size(), column,
                       quoted_word(name)));
    }
    fail(fmt::format("{} is no number (property {} expected)", quoted_word(word(p, end)), quoted_word(name)));
  }

  /// Floats under an integer type are a wrong header (colours 0-1 called uchar): read on, they would all round to
  /// nothing.
  void require_type(double value, const char* p, const char* stop, const PointColumn& column) const {
    const ScalarRange limits = scalar_range(column.type);
    if (value >= limits.low && value <= limits.high && value == static_cast<double>(static_cast<long long>(value)))
      return;
    fail(fmt::format("property {} is {}, which is no {} as the header says", quoted_word(column.name),
                     quoted_word(word(p, stop)), ply_name(column.type)));
  }

  InputFile file_;
  PlyHeader header_;
  PlyRows rows_;
  LineReader lines_;
  std::uint64_t next_ = 0;  ///< vertex the next line holds
  bool rest_seen_ = false;
};

}  // namespace

std::unique_ptr<PointSource> open_ply(InputFile file, const std::string& path) {
  const PlyHeader header = read_ply_header(file);
  PlyRows rows = understand_vertices(header, path, file.name);
  const std::shared_ptr<const ScanGrid> grid = read_range_grid(file, header);
  std::unique_ptr<PointSource> source;
  if (header.format == PlyFormat::ascii) {
    source = std::make_unique<AsciiPly>(std::move(file), header, std::move(rows));
  } else {
    source = std::make_unique<BinaryPly>(std::move(file), header, std::move(rows));
  }
  return grid ? organised_points(std::move(source), grid) : std::move(source);
}

// Points to binary little-endian PLY.
namespace {

void require_names(const PointColumns& columns) {
  std::vector<std::string_view> names;
  if (!columns.radius.empty()) names.push_back(columns.radius);
  if (!columns.quality.empty()) names.push_back(columns.quality);
  for (const AttributeSpec& spec : columns.attributes) names.push_back(spec.name);
  require_ply_names("column", names);
}

PointColumns checked(const PointColumns& columns) {
  require_names(columns);
  return columns;
}

class PlyPointsWriter final : public PointsWriter {
 public:
  PlyPointsWriter(const std::string& path, const PointColumns& columns, const PointsWriterSettings& settings)
      : PointsWriter(checked(columns)),
        settings_(settings),
        codec_(columns),
        rows_out_(path, settings, settings.count.has_value()),
        writer_(codec_.row_bytes()) {
    if (!settings_.crs.empty()) settings_.comments.push_back("crs " + settings_.crs);
    const std::string header = ply_points_header(columns_, settings_.comments, settings_.count.value_or(0));
    rows_out_.check(write_all(rows_out_.fd(), header.data(), header.size()));
  }

  void append(const SampleBatch& batch) override {
    rows_out_.require_open();
    codec_.require_writable(batch, rows_, rows_out_.name());
    rows_out_.check(writer_.append(rows_out_.fd(), batch.size(), [&](std::byte* to, std::size_t first, std::size_t n) {
      codec_.encode(batch, first, n, to);
    }));
    rows_ += batch.size();
  }

  void commit() override {
    rows_out_.require_all(rows_);
    rows_out_.check(writer_.flush(rows_out_.fd()));
    const std::string header = ply_points_header(columns_, settings_.comments, rows_);
    rows_out_.publish(header, header.size() + writer_.written());
  }

 private:
  PointsWriterSettings settings_;
  RowCodec codec_;
  StagedRows rows_out_;
  SoleRecordWriter writer_;
};

}  // namespace

std::string ply_points_header(const PointColumns& columns, const std::vector<std::string>& comments,
                              std::uint64_t count) {
  std::string text = fmt::format("ply\nformat binary_little_endian 1.0\ncomment made by lamina {}\n", version());
  for (const std::string& comment : comments) text += ply_comment(comment);
  const std::string digits = fmt::format("{}", count);
  // A number that is known only at the end must not move the rows.
  const std::size_t most = std::numeric_limits<std::uint64_t>::digits10 + 1;
  text += fmt::format("comment {}\nelement vertex {}\n", std::string(most - digits.size(), '-'), digits);
  const auto property = [&](ScalarType type, std::string_view name) {
    text += fmt::format("property {} {}\n", ply_name(type), name);
  };
  for (const char* axis : {"x", "y", "z"})
    property(columns.double_positions ? ScalarType::float64 : ScalarType::float32, axis);
  if (columns.normals)
    for (const char* axis : {"nx", "ny", "nz"}) property(ScalarType::float32, axis);
  if (!columns.radius.empty()) property(ScalarType::float32, columns.radius);
  if (!columns.quality.empty()) property(ScalarType::float32, columns.quality);
  for (const AttributeSpec& spec : columns.attributes) property(spec.type, spec.name);
  return text + "end_header\n";
}

std::unique_ptr<PointsWriter> open_ply_points_writer(const std::string& path, const PointColumns& columns,
                                                     const PointsWriterSettings& settings) {
  return std::make_unique<PlyPointsWriter>(path, columns, settings);
}

}  // namespace lamina
