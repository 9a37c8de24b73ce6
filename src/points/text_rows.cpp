#include "points/text_rows.h"

#include <fmt/compile.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <iterator>
#include <set>
#include <string_view>
#include <utility>

#include "base/descriptor.h"
#include "base/number.h"
#include "lamina/error.h"
#include "points/formats.h"
#include "points/point_columns.h"

namespace lamina {
namespace {

constexpr std::size_t kLongestLine = 64 << 20;

bool is_blank(std::string_view line) {
  return line.find_first_not_of(" \t\r\v\f") == std::string_view::npos;
}

constexpr char kQuote = '"';

const char* skip_blanks(const char* p, const char* end) {
  while (p != end && is_space(*p)) ++p;
  return p;
}

/// A number alone or in quotes; returns where it ends, null when it is none.
const char* parse_word(const char* p, const char* end, double& value) {
  if (*p != kQuote) return parse_number(p, end, value);
  const char* stop = parse_number(skip_blanks(p + 1, end), end, value);
  if (stop != nullptr) stop = skip_blanks(stop, end);
  return stop == nullptr || stop == end || *stop != kQuote ? nullptr : stop + 1;
}

/// A quoted word may hold separators.
const char* end_of_word(const char* p, const char* end, char separator) {
  if (p != end && *p == kQuote) {
    const char* closing = std::find(p + 1, end, kQuote);
    p = closing == end ? end : closing + 1;
  }
  while (p != end && *p != separator && !(separator == kBlanks && is_space(*p))) ++p;
  return p;
}

/// Values that a column can hold: integers those of their type. Colours given as floats lie between 0 and 1.
ScalarRange value_range(const PointColumn& column) {
  const bool colour = column.name == "red" || column.name == "green" || column.name == "blue";
  if (!is_integer_type(column.type) && column.role == Role::attribute && colour) return {0, 1};
  return scalar_range(column.type);
}

}  // namespace

LineReader::LineReader(const InputFile& file, std::uint64_t offset, std::uint64_t lines, char line_end)
    : file_(&file),
      offset_(offset),
      line_(lines),
      line_end_(line_end),
      buffer_(static_cast<std::size_t>(std::min<std::uint64_t>(kReadBytes, file.bytes + 1))) {}

bool LineReader::next(std::string_view& line) {
  while (next_of_any_kind(line)) {
    if (!is_blank(line)) return true;
  }
  return false;
}

bool LineReader::next_of_any_kind(std::string_view& line) {
  std::size_t searched = 0;
  for (;;) {
    const std::size_t size = end_ - begin_;
    const char* start = buffer_.data() + begin_;
    const void* found = std::memchr(start + searched, line_end_, size - searched);
    if (found != nullptr) {
      const auto length = static_cast<std::size_t>(static_cast<const char*>(found) - start);
      line = {start, length};
      line_offset_ = offset_ - size;
      begin_ += length + 1;
      ++line_;
      return true;
    }
    searched = size;
    if (refill()) continue;
    if (size == 0) return false;
    line = {buffer_.data() + begin_, size};  // the last line, unended
    line_offset_ = offset_ - size;
    begin_ = end_;
    ++line_;
    return true;
  }
}

/// Appends bytes of the file to the unread ones, which move to the front; false at the end of the file.
bool LineReader::refill() {
  std::memmove(buffer_.data(), buffer_.data() + begin_, end_ - begin_);
  end_ -= begin_;
  begin_ = 0;
  if (end_ == buffer_.size()) {
    if (buffer_.size() >= kLongestLine) {
      throw Error(ExitCode::unreadable, fmt::format("{}, line {}: longer than {} bytes; is this a text file?",
                                                    file_->name, line_ + 1, kLongestLine));
    }
    buffer_.resize(buffer_.size() * 2);
  }
  const std::size_t got = file_->read(offset_, buffer_.data() + end_, buffer_.size() - end_);
  if (offset_ == 0 && std::string_view(buffer_.data(), got).starts_with(kByteOrderMark)) begin_ = kByteOrderMark.size();
  offset_ += got;
  end_ += got;
  return got > 0;
}

char line_end_of(const InputFile& file) {
  std::string start(static_cast<std::size_t>(std::min<std::uint64_t>(file.bytes, kSniffBytes)), '\0');
  start.resize(file.read(0, start.data(), start.size()));
  return start.find('\n') == std::string::npos && start.find('\r') != std::string::npos ? '\r' : '\n';
}

void fail_at(const InputFile& file, std::uint64_t line, const std::string& what) {
  throw Error(ExitCode::unreadable, fmt::format("{}, line {}: {}", file.name, line, what));
}

void report_vanished_rows(const InputFile& file, std::uint64_t line) {
  throw Error(
      ExitCode::unreadable,
      fmt::format("{}: ends at line {}, it was longer when it was opened: is it being written?", file.name, line));
}

void split_line(std::string_view line, char separator, std::vector<std::string_view>& words) {
  words.clear();
  const char* p = line.data();
  const char* const end = p + line.size();
  for (p = skip_blanks(p, end); p != end; p = skip_blanks(p, end)) {
    const char* stop = end_of_word(p, end, separator);
    const char* last = stop;
    while (last != p && is_space(last[-1])) --last;
    const bool quoted = last - p >= 2 && *p == kQuote && last[-1] == kQuote;
    words.emplace_back(quoted ? p + 1 : p, static_cast<std::size_t>(last - p - (quoted ? 2 : 0)));
    p = stop;
    if (separator != kBlanks && p != end && ++p == end) words.emplace_back(p, 0);
  }
}

RowParser::RowParser(std::vector<PointColumn> columns, char separator, std::string remedy)
    : columns_(std::move(columns)), separator_(separator), remedy_(std::move(remedy)) {
  for (const PointColumn& column : columns_) ranges_.push_back(value_range(column));
}

/// A place on a line.
class RowParser::Cursor {
 public:
  Cursor(const InputFile& file, std::string_view line, std::uint64_t number, char separator)
      : p(line.data()), end(line.data() + line.size()), separator_(separator), file_(file), number_(number) {}

  [[noreturn]] void fail(const std::string& what) const { fail_at(file_, number_, what); }
  void skip_blanks() { p = lamina::skip_blanks(p, end); }
  [[nodiscard]] const char* word_end() const { return end_of_word(p, end, separator_); }
  /// What stands from here to `stop`, for messages.
  [[nodiscard]] std::string word(const char* stop) const {
    return quoted_word({p, static_cast<std::size_t>(stop - p)});
  }

  /// Passes over the mark between two values; false when the line has none here.
  bool take_separator() {
    if (separator_ == kBlanks) return false;
    skip_blanks();
    if (p == end) return false;
    if (*p != separator_) {
      fail(fmt::format("{} stands where a '{}' should", word(end_of_word(p, end, kBlanks)), separator_));
    }
    ++p;
    return true;
  }

  const char* p;
  const char* const end;

 private:
  char separator_;
  const InputFile& file_;
  std::uint64_t number_;
};

double RowParser::take_value(Cursor& cursor, std::size_t column) const {
  double value = 0;
  const char* const stop = parse_word(cursor.p, cursor.end, value);
  if (stop == nullptr || (stop != cursor.end && !is_space(*stop) && *stop != separator_)) {
    cursor.fail(fmt::format("{} is no number ({} expected)", cursor.word(cursor.word_end()),
                            quoted_word(columns_[column].name)));
  }
  const ScalarRange& range = ranges_[column];
  const bool no_integer = std::isnan(value) && is_integer_type(columns_[column].type);
  if (value < range.low || value > range.high || no_integer) {
    cursor.fail(fmt::format("{} is {}, outside {:g} to {:g}{}", quoted_word(columns_[column].name), cursor.word(stop),
                            range.low, range.high, remedy_));
  }
  cursor.p = stop;
  return value;
}

void RowParser::parse(const InputFile& file, std::string_view line, std::uint64_t line_number, std::size_t at,
                      const std::vector<ColumnTarget>& targets) const {
  Cursor cursor(file, line, line_number, separator_);
  bool more = false;  // a separator stands before, so that there is a value even if it is empty
  for (std::size_t c = 0; c < targets.size(); ++c) {
    cursor.skip_blanks();
    const bool wanted = targets[c].wide != nullptr || targets[c].narrow != nullptr;
    if (cursor.p == cursor.end && (wanted || !more)) {
      cursor.fail(fmt::format("{} values expected, only {} stand there ({} is missing)", targets.size(), c,
                              quoted_word(columns_[c].name)));
    }
    if (!wanted) {
      cursor.p = cursor.word_end();
    } else if (targets[c].wide != nullptr) {
      targets[c].wide[at] = take_value(cursor, c);
    } else {
      targets[c].narrow[at] = static_cast<float>(take_value(cursor, c));
    }
    more = cursor.take_separator();
  }
  cursor.skip_blanks();
  if (cursor.p != cursor.end) {
    cursor.fail(fmt::format("{} values expected, more stand there, from {} on", targets.size(),
                            cursor.word(cursor.word_end())));
  }
}

namespace {

constexpr std::size_t kFlushBytes = 256 << 10;

/// Names in the order of a row. Throws when one of them would not come back from a line of names.
std::vector<std::string> names_of(const PointColumns& columns) {
  std::vector<std::string> names{"x", "y", "z"};
  if (columns.normals) names.insert(names.end(), {"nx", "ny", "nz"});
  if (!columns.radius.empty()) names.push_back(columns.radius);
  if (!columns.quality.empty()) names.push_back(columns.quality);
  for (const AttributeSpec& spec : columns.attributes) names.push_back(spec.name);
  std::set<std::string_view> seen;
  for (const std::string& name : names) {
    const bool plain = !name.empty() && name.find_first_of(" \t\r\n\v\f,;\"'") == std::string::npos;
    if (!plain || !seen.insert(name).second) {
      throw Error(ExitCode::internal,
                  fmt::format("column '{}' cannot be written as text: its name is empty, has blanks or "
                              "commas, or is there twice",
                              name));
    }
  }
  return names;
}

/// Integers print as such, rounded and clamped to their type.
double in_type(double value, ScalarType type) {
  if (!is_integer_type(type)) return value;
  const ScalarRange range = scalar_range(type);
  return std::clamp(std::nearbyint(value), range.low, range.high);
}

class TextPointsWriter final : public PointsWriter {
 public:
  TextPointsWriter(const std::string& path, const PointColumns& columns, const PointsWriterSettings& settings,
                   char separator)
      : PointsWriter(columns),
        settings_(settings),
        codec_(columns),
        separator_(separator),
        header_(header_line(names_of(columns))),
        rows_out_(path, settings, true) {
    rows_out_.check(write_all(rows_out_.fd(), header_.data(), header_.size()));
    written_ = header_.size();
  }

  void append(const SampleBatch& batch) override {
    rows_out_.require_open();
    codec_.require_writable(batch, rows_, rows_out_.name());
    for (std::size_t i = 0; i < batch.size(); ++i) {
      put_row(batch, i);
      if (text_.size() >= kFlushBytes) flush();
    }
    rows_ += batch.size();
  }

  void commit() override {
    rows_out_.require_all(rows_);
    flush();
    rows_out_.publish(header_, written_);
  }

 private:
  [[nodiscard]] std::string header_line(const std::vector<std::string>& names) const {
    std::string line = separator_ == ',' ? "" : "# ";
    for (std::size_t i = 0; i < names.size(); ++i) line += (i == 0 ? "" : std::string(1, separator_)) + names[i];
    return line + "\n";
  }

  template <class Number>
  void put(Number value) {
    fmt::format_to(std::back_inserter(text_), FMT_COMPILE("{}{}"), value, separator_);
  }

  void put_row(const SampleBatch& b, std::size_t i) {
    for (const double v : {b.x[i], b.y[i], b.z[i]}) {
      columns_.double_positions ? put(v) : put(static_cast<float>(v));
    }
    if (columns_.normals) {
      for (const float v : {b.nx[i], b.ny[i], b.nz[i]}) put(v);
    }
    if (!columns_.radius.empty()) put(b.radius[i]);
    if (!columns_.quality.empty()) put(b.quality[i]);
    for (std::size_t a = 0; a < columns_.attributes.size(); ++a) {
      const ScalarType type = columns_.attributes[a].type;
      const bool exact = a < b.exact.size() && !b.exact[a].empty();
      const double value = in_type(exact ? b.exact[a][i] : double{b.attributes[a][i]}, type);
      type == ScalarType::float32 ? put(static_cast<float>(value)) : put(value);
    }
    text_[text_.size() - 1] = '\n';
  }

  void flush() {
    rows_out_.check(write_all(rows_out_.fd(), text_.data(), text_.size()));
    written_ += text_.size();
    text_.clear();
  }

  PointsWriterSettings settings_;
  RowCodec codec_;
  char separator_;
  std::string header_;
  StagedRows rows_out_;
  fmt::memory_buffer text_;
  std::uint64_t written_ = 0;
};

}  // namespace

std::unique_ptr<PointsWriter> open_xyz_points_writer(const std::string& path, const PointColumns& columns,
                                                     const PointsWriterSettings& settings) {
  return std::make_unique<TextPointsWriter>(path, columns, settings, ' ');
}

std::unique_ptr<PointsWriter> open_csv_points_writer(const std::string& path, const PointColumns& columns,
                                                     const PointsWriterSettings& settings) {
  return std::make_unique<TextPointsWriter>(path, columns, settings, ',');
}

}  // namespace lamina
