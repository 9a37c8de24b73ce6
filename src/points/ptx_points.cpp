#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "base/number.h"
#include "lamina/error.h"
#include "points/formats.h"
#include "points/point_columns.h"
#include "points/scans.h"
#include "points/text_rows.h"

namespace lamina {
namespace {

/// A place of the grid the scanner got nothing back from: three zeros, however written.
bool is_missing(std::string_view line) {
  const char* p = line.data();
  const char* const end = p + line.size();
  for (int k = 0; k < 3; ++k) {
    while (p != end && is_space(*p)) ++p;
    const char* word = p;
    while (p != end && (*p == '0' || *p == '.' || *p == '-' || *p == '+')) ++p;
    if (p == word || (p != end && !is_space(*p))) return false;
  }
  return true;
}

bool is_return(std::string_view line) {
  return !is_missing(line);
}

class PtxPoints final : public PointSource, public OrganisedPoints {
 public:
  PtxPoints(InputFile file, const std::string& path) : file_(std::move(file)), line_end_(line_end_of(file_)) {
    info_.path = path;
    info_.random_access = true;
    index_scans();
    std::vector<PointColumn> columns{
        {"x", ScalarType::float64}, {"y", ScalarType::float64}, {"z", ScalarType::float64}};
    const std::size_t values = scans_.empty() ? 4 : values_;
    if (values != 3 && values != 4 && values != 7) {
      throw Error(ExitCode::unreadable,
                  fmt::format("{}, line {}: {} values; x y z, intensity and red green blue expected", file_.name,
                              values_line_, values));
    }
    if (values > 3) columns.push_back({"intensity"});
    for (const char* name : {"red", "green", "blue"}) {
      if (values == 7) columns.push_back({name, ScalarType::uint8});
    }
    give_roles(columns, info_, file_.name, "value");
    parser_.emplace(std::move(columns), kBlanks, "");
  }

  void read(std::uint64_t first, std::size_t count, SampleBatch& out) override {
    const RowRange rows = rows_there(info_, first, count);
    const std::vector<ColumnTarget> targets = prepare_batch(info_, parser_->columns(), rows, out);
    auto scan = std::upper_bound(scans_.begin(), scans_.end(), rows.first,
                                 [](std::uint64_t row, const Scan& s) { return row < s.first; });
    std::size_t done = 0;
    if (rows.count > 0) --scan;
    for (; done < rows.count; ++scan) {
      const std::uint64_t begin = rows.first + done - scan->first;
      const auto n = static_cast<std::size_t>(std::min<std::uint64_t>(rows.count - done, scan->rows.count() - begin));
      for_rows(file_, line_end_, scan->rows, {begin, n}, is_return,
               [&](std::string_view line, std::uint64_t number, std::size_t i) {
                 parser_->parse(file_, line, number, done + i, targets);
               });
      scan->transform.apply(out, done, done + n);
      done += n;
    }
  }

  [[nodiscard]] std::vector<PlacedGrid> grids() const override {
    std::vector<PlacedGrid> placed;
    for (const Scan& scan : scans_) placed.push_back({scan.first, scan.grid});
    return placed;
  }

 private:
  struct Scan {
    std::uint64_t first = 0;
    PoseTransform transform;
    RowIndex rows;
    std::shared_ptr<const ScanGrid> grid;
  };

  /// The next line of a scan's header: `wanted` numbers.
  std::vector<double> header_line(LineReader& lines, std::string_view line, std::size_t wanted) const {
    std::vector<std::string_view> words;
    split_line(line, kBlanks, words);
    std::vector<double> values(words.size());
    for (std::size_t i = 0; i < words.size(); ++i) {
      if (words.size() != wanted || !is_number(words[i], values[i])) {
        throw Error(
            ExitCode::unreadable,
            fmt::format("{}, line {}: a scan's header should have {} numbers here: an earlier scan's number of columns "
                        "or rows may be wrong",
                        file_.name, lines.line(), wanted));
      }
    }
    return values;
  }

  std::vector<double> next_header_line(LineReader& lines, std::size_t wanted) const {
    std::string_view line;
    if (!lines.next(line)) {
      throw Error(ExitCode::unreadable, fmt::format("{}: ends at line {}, in the header of a scan: it was cut short",
                                                    file_.name, lines.line()));
    }
    return header_line(lines, line, wanted);
  }

  static std::uint64_t count_of(double value, const InputFile& file, const LineReader& lines) {
    if (!(value >= 0 && value < 0x1p31 && value == std::floor(value))) {
      throw Error(ExitCode::unreadable,
                  fmt::format("{}, line {}: a number of columns or rows expected", file.name, lines.line()));
    }
    return static_cast<std::uint64_t>(value);
  }

  void index_scans() {
    LineReader lines(file_, 0, 0, line_end_);
    std::string_view line;
    std::vector<std::string_view> words;
    while (lines.next(line)) {
      if (is_comment(line)) continue;
      const std::uint64_t across = count_of(header_line(lines, line, 1)[0], file_, lines);
      const std::uint64_t down = count_of(next_header_line(lines, 1)[0], file_, lines);
      for (int k = 0; k < 4; ++k) next_header_line(lines, 3);  // the scanner's place and axes, which the matrix repeats
      const std::uint64_t matrix_line = lines.line() + 1;
      Pose pose{};
      for (std::size_t c = 0; c < 4; ++c) {  // stored for points as rows: transposed
        const std::vector<double> values = next_header_line(lines, 4);
        for (std::size_t r = 0; r < 4; ++r) pose[r][c] = values[r];
      }
      Scan scan{info_.count, PoseTransform(pose, fmt::format("{}, line {}", file_.name, matrix_line)), {}, {}};
      const auto grid = std::make_shared<ScanGrid>(std::max<std::uint64_t>(down, 1));  // column by column
      scan.grid = grid;
      for (std::uint64_t left = across * down; left > 0; --left) {
        if (!lines.next(line)) {
          throw Error(
              ExitCode::unreadable,
              fmt::format(
                  "{}: a scan of {} by {} points lacks {} of them when the file ends at line {}: it was cut short",
                  file_.name, across, down, left, lines.line()));
        }
        if (values_ == 0) {
          split_line(line, kBlanks, words);
          values_ = words.size();
          values_line_ = lines.line();
        }
        const bool filled = !is_missing(line);
        grid->add(filled);
        if (filled) scan.rows.add(lines);
      }
      if (scan.rows.count() > 0)
        info_.scans.push_back({info_.count, ScanPart::Scanner::position, {pose[0][3], pose[1][3], pose[2][3]}});
      info_.count += scan.rows.count();
      if (scan.rows.count() > 0) scans_.push_back(std::move(scan));
    }
  }

  InputFile file_;
  char line_end_;
  std::vector<Scan> scans_;
  std::size_t values_ = 0;  ///< on a row
  std::uint64_t values_line_ = 0;
  std::optional<RowParser> parser_;
};

}  // namespace

std::unique_ptr<PointSource> open_ptx(InputFile file, const std::string& path) {
  return std::make_unique<PtxPoints>(std::move(file), path);
}

}  // namespace lamina
